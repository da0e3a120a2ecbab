"""How far the frequencies of finite cells are from those of the solid.

More functions can only lower an eigenvalue. Cells get some of higher degree, see
`solver.accuracy.enriched`, and what one step towards the solution with them gains of a mode, see
`solver.accuracy.stars`, is a lower bound of its error. What further steps and functions would gain
is about as much again, on solids whose frequencies are known; see docs/explanation/finite-cells.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array
from carillon.errors import UserError
from carillon.fem.finite_cells.basis import DEGREE
from carillon.fem.finite_cells.model import FiniteCellModel
from solver.accuracy.enriched import enriched
from solver.accuracy.stars import gained
from solver.refinement.errors import LAST, ExpectedErrors

BEYOND = 2.4
"""What an eigenvalue is expected to fall by, over what one step gains: the median of solids whose
frequencies are known."""
LEAST_SEEN = 0.2
"""Share of the strain energy in cells whose errors can be told, below which none are."""
HALVED = 8.0
"""Factor by which dividing a cell and those about it diminishes its share of the error. No measure
of how smooth modes are in a cell foretells it better."""


@dataclass(frozen=True)
class CellErrors:
    """Expected errors of the frequencies of finite cells."""

    errors: ExpectedErrors
    """Of the frequencies; positive, since they are too high."""
    shares: Array
    """(c,) each cell's share in them, root mean square over the modes."""


def estimate_cell_errors(model: FiniteCellModel, values: Array, modes: Array) -> CellErrors:
    """Expected errors of the frequencies of finite cells against the solid's, up to mode `LAST`.

    `values` (k,) are eigenvalues [rad^2/s^2] and `modes` (n_dofs, k) mass-normalised, the rigid
    ones included. Raises UserError for cells of another degree than four, those of files, which
    lack the moments, and where most are of several materials or held.

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
    if model.cells.degree != DEGREE or model.cells.line_weights is None:
        raise UserError("errors of cells from files are not estimated; expected those of a surface")
    elastic = slice(model.rigid_modes, min(LAST, len(values)))
    own = values[elastic]
    space = enriched(model)
    chosen = np.ascontiguousarray(modes[:, elastic])
    # Cells of several materials, and those that are held, are taken to err as the others do.
    seen = space.usable_share(chosen)
    if np.median(seen) < LEAST_SEEN:
        raise UserError(
            f"cells of several materials, or that are held, have {1.0 - np.median(seen):.0%} of "
            f"the strain energy, expected at most {1.0 - LEAST_SEEN:.0%}; raise the resolution"
        )
    gain, within = gained(space, space.residual(own, chosen))
    gain = gain / np.maximum(seen, LEAST_SEEN)
    relative = np.sqrt(1.0 + BEYOND * gain / own) - 1.0
    shares = relative * within
    errors = ExpectedErrors(relative, model.rigid_modes)
    return CellErrors(errors, np.sqrt(np.mean(shares**2, axis=1)))
