"""Lowest modes of one subdomain."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from solver.distribution import Cells
from solver.hcms.condense import restrict_mass, restrict_stiffness
from solver.lowest import lowest_modes
from solver.model import RIGID_MODES
from solver.sparse import assemble_elements

Array = NDArray[np.float64]

ZERO_FRACTION = 1e-10
"""A local eigenvalue below this fraction of the ratio of the diagonals is a rigid motion's."""


def local_modes(
    cells: Cells, start: int, stop: int, keep: int, interface: str
) -> tuple[Array, Array]:
    """Lowest eigenpairs of the subdomain that consists of the rows [start, stop).

    Parameters
    ----------
    cells
        The cells that touch the subdomain.  Those that straddle its boundary are restricted to the
        nodes inside, see `solver.hcms.condense`.
    keep
        Wanted number of modes; more come back if there are more motions without strain, all of
        which are kept, and never fewer than the six rigid ones.
    interface
        `free` or `fixed`.

    Returns
    -------
    values (k,) [rad^2/s^2] and mass-orthonormal vectors (3 (stop - start), k).
    """
    K, M = subdomain_matrices(cells, start, stop, interface)
    size = K.shape[0]
    zero = ZERO_FRACTION * K.diagonal().mean() / M.diagonal().mean()
    count = min(max(keep, RIGID_MODES), size)
    while True:
        values, vectors = lowest_modes(K, M, count)
        if count == size or values[-1] > zero:
            return values, vectors
        count = min(2 * count, size)


def subdomain_matrices(
    cells: Cells, start: int, stop: int, interface: str
) -> tuple[sp.csr_matrix, sp.csr_matrix]:
    """Stiffness [N/m] and mass [kg] of a subdomain, each (3 (stop - start), 3 (stop - start))."""
    inside = cells.inside(start, stop)
    stiffness = restrict_stiffness(cells.elements.stiffness(), inside, interface)
    mass = restrict_mass(cells.elements.nodal_mass(), inside)
    # Rows and columns of outside corners are zero, so any inside node may stand for them.
    rows = np.where(inside, cells.corners - start, 0)
    return assemble_elements(rows, stiffness, mass, stop - start)
