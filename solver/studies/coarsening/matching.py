"""Which coarse mode is which mode of the fine solid, whatever their numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from carillon.fem.geometry import Blocks, prolongation
from carillon.fem.model import ElasticModel
from solver.refinement.estimate import nodal_mass_matrix

Array = NDArray[np.float64]

FAR_OFF = 0.10
"""Relative error of a frequency from which a mode is given a verdict."""

SAME = 0.5
"""Overlap from which two modes count as the same."""

SWAP, LOCAL, ERROR = "swap", "local", "error"
"""Verdicts: the mode is there, and good, under another number; no coarse mode resembles it, so it
lives where the coarse mesh does not resolve it; it is there at a wrong frequency."""


@dataclass(frozen=True)
class Matching:
    """The coarse mode of each mode of the fine solid, no two the same.

    Attributes
    ----------
    partners : (k,)
        Indices among the coarse modes.
    overlaps : (k,)
        With the partner: 1 for the same shape, 0 for an orthogonal one.
    largest : (k,)
        With any coarse mode.
    """

    partners: NDArray[np.int64]
    overlaps: Array
    largest: Array


def mode_overlaps(fine: ElasticModel, modes: Array, blocks: Blocks, coarse_modes: Array) -> Array:
    """Overlaps |v^T M P u| (k, l) of fine modes (n_dofs, k) and coarse ones (coarse n_dofs, l).

    P interpolates to the fine nodes; P u, like v, has unit mass.
    """
    mass, interpolation = nodal_mass_matrix(fine), prolongation(blocks)
    nodal = interpolation @ coarse_modes.reshape(blocks.coarse.n_nodes, -1)
    weighted = (mass @ nodal).reshape(-1, coarse_modes.shape[1])
    prolonged = nodal.reshape(weighted.shape)
    norms = np.sqrt((prolonged * weighted).sum(axis=0))
    return np.asarray(np.abs(modes.T @ (weighted / norms)))


def match_modes(overlaps: Array) -> Matching:
    """Pair the rows of overlaps (k, l >= k) with columns so that their sum is largest.

    Examples
    --------
    >>> match_modes(np.array([[0.1, 0.9, 0.0], [0.8, 0.3, 0.1]])).partners.tolist()
    [1, 0]
    """
    rows, partners = linear_sum_assignment(overlaps, maximize=True)
    return Matching(partners, overlaps[rows, partners], overlaps.max(axis=1))


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
