"""How far the frequencies of finite cells are from those of the solid.

Let an error e fall by the factor r when cells are halved: 16 where displacements are smooth, less
at edges that point inwards and other singular places. If cells were twice and four times as large,
modes would lose L2 = e (r - 1) and L4 = e (r^2 - 1), which `solver.accuracy.surplus` finds. So,
place by place, r = L4 / L2 - 1 and e = L2 / (r - 1): Richardson's extrapolation without a second
solve. What none of these cells can do is added, see `solver.accuracy.cubics`.
"""

from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array
from carillon.fem.finite_cells.model import FiniteCellModel
from solver.accuracy.cubics import CubicSurplus, cubic_surplus
from solver.accuracy.surplus import losses
from solver.refinement.errors import LAST, ExpectedErrors

SLOWEST, FASTEST = 2.0, 16.0
"""Bounds of the factor by which halved cells diminish an error: that of cracks, and of smooth
displacements."""
MOST_LOST = 0.9
"""Largest share of an eigenvalue that functions left out may take from it."""


@dataclass(frozen=True)
class CellErrors:
    """Expected errors of the frequencies of finite cells."""

    errors: ExpectedErrors
    """Of the frequencies; positive, since they are too high."""
    shares: Array
    """(c,) each cell's share in them, root mean square over the modes."""
    factors: Array
    """(c,) by which dividing the cell would diminish its share."""


def estimate_cell_errors(model: FiniteCellModel, values: Array, modes: Array) -> CellErrors:
    """Expected errors of the frequencies of finite cells against the solid's, up to mode `LAST`.

    `values` (k,) are eigenvalues [rad^2/s^2] and `modes` (n_dofs, k) mass-normalised, the six rigid
    ones included.

    Examples
    --------
    >>> import solver
    >>> from carillon.fem.finite_cells.build import finite_cells
    >>> from carillon.fem.finite_cells.model import finite_cell_model
    >>> from carillon.fem.geometry import builtin_surface
    >>> cells = finite_cells(builtin_surface("plate"), 12)
    >>> model = finite_cell_model(cells, np.full(cells.mesh.n_cells, 1e9))
    >>> found = solver.solve(model, modes=20, method="slepc")
    >>> 0.0 < estimate_cell_errors(model, found.eigenvalues, found.modes).errors.rms < 0.2
    True
    """
    elastic = slice(model.rigid_modes, min(LAST, len(values)))
    chosen = np.ascontiguousarray(modes[:, elastic])
    twice, fourfold, group = losses(model, chosen)
    own = values[elastic]
    lost = np.stack([np.bincount(group, (each / own).sum(axis=1)) for each in (twice, fourfold)])
    ratio = lost[1] / np.maximum(lost[0], np.finfo(float).tiny)
    factors = np.clip(ratio - 1.0, SLOWEST, FASTEST)[group]
    # A frequency's relative error is half its eigenvalue's.
    shares = 0.5 * twice / own / (factors - 1.0)[:, None]
    shares += _unseen(cubic_surplus(model, own, chosen), own, shares.sum(axis=0))
    errors = ExpectedErrors(shares.sum(axis=0), model.rigid_modes)
    return CellErrors(errors, np.sqrt(np.mean(shares**2, axis=1)), factors)


def _unseen(surplus: CubicSurplus, own: Array, errors: Array) -> Array:
    """Relative errors (c, k) in each cell by which extrapolated ones (k,) are below the surplus's.

    Extrapolation sees nothing of what cells of no size can do.
    """
    lost = np.minimum(surplus.gains / own, MOST_LOST)
    missing = np.maximum(1.0 / np.sqrt(1.0 - lost) - 1.0 - errors, 0.0)
    total = np.maximum(surplus.shares.sum(axis=0), np.finfo(float).tiny)
    return np.asarray(missing * surplus.shares / total)
