"""What is wrong with modes of a coarse model that are far off."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carillon.fem.geometry import Blocks, prolongation
from carillon.fem.model import ElasticModel
from solver.refinement.estimate import nodal_mass_matrix
from solver.verification.matching import SAME, mode_overlaps

Array = NDArray[np.float64]

FAR_OFF = 0.10
"""Relative error of a frequency from which a mode is given a verdict."""

SWAP, LOCAL, ERROR = "swap", "local", "error"
"""Verdicts: the mode is there, and good, under another number; no coarse mode resembles it, so it
lives where the coarse mesh does not resolve it; it is there at a wrong frequency."""


def coarse_overlaps(fine: ElasticModel, modes: Array, blocks: Blocks, coarse_modes: Array) -> Array:
    """Overlaps (k, l) of fine modes (n_dofs, k) and coarse ones (coarse n_dofs, l).

    See `solver.verification.matching.mode_overlaps`; coarse modes are prolonged to the fine nodes.
    """
    nodal = prolongation(blocks) @ coarse_modes.reshape(blocks.coarse.n_nodes, -1)
    weighted = nodal_mass_matrix(fine) @ nodal
    shape = (-1, coarse_modes.shape[1])
    return mode_overlaps(modes, nodal.reshape(shape), weighted.reshape(shape))


def verdict(error: float, overlap: float, largest: float) -> str:
    """What is wrong with a mode whose frequency is far off the one of its number.

    Parameters
    ----------
    error
        Relative error of its partner's frequency.
    overlap, largest
        With its partner and with any coarse mode.
    """
    if overlap >= SAME and abs(error) <= FAR_OFF:
        return SWAP
    return ERROR if largest > SAME else LOCAL
