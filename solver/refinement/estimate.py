"""How far off a coarse model's frequencies are, and through which elements.

`TwoGrid` gives the frequencies of the fine solid to a few tenths of what the coarse ones miss. The
coarse eigenvalue and the fine one differ by what the elements make of the same motion: with a fine
mode v and the coarse displacements u that are nearest to it (in the norm of the mass) the strain
energy of an element, u^T K_c u, ought to be that of its fine cells, v^T K v. How far it is from
that, relative to the mode's, is the element's share of the error. It tells which elements to keep
fine; the sum of the shares is not the error, since u is no coarse mode.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from carillon.fem.geometry import Blocks, prolongation
from carillon.fem.model import RIGID_MODES, ElasticModel
from solver.assembly.sparse import sum_blocks
from solver.refinement.energies import element_energies, fine_energies
from solver.refinement.errors import LAST, ExpectedErrors
from solver.refinement.two_grid import TwoGrid

Array = NDArray[np.float64]

MODES_USED = LAST + 12
"""Modes that are corrected, since modes may change places."""


@dataclass(frozen=True)
class ErrorEstimate:
    """Expected errors of a coarse model's frequencies.

    Attributes
    ----------
    errors
        Of the frequencies.
    shares : (mc,)
        Root mean square over these modes of each element's share of the eigenvalues' error; 0 for
        fine cells.
    """

    errors: ExpectedErrors
    shares: Array


def estimate_errors(
    two_grid: TwoGrid, blocks: Blocks, coarse: ElasticModel, values: Array, modes: Array
) -> ErrorEstimate:
    """Expected errors of the frequencies of a coarse model, up to mode `LAST`.

    Parameters
    ----------
    two_grid
        Of the fine solid.
    blocks, coarse
        The coarse mesh, plain or mixed, and the model on it.
    values, modes
        (k,) eigenvalues [rad^2/s^2] and (coarse n_dofs, k) modes, the six rigid ones included.

    Examples
    --------
    >>> import solver
    >>> from carillon.fem.geometry import (
    ...     blocks_from_mesh, builtin_surface, hexmesh_from_voxels, voxelize
    ... )
    >>> from carillon.fem.model import fine_model
    >>> from solver.coarsening.choice import make_coarsening
    >>> from solver.coarsening.model import build_model
    >>> mesh = hexmesh_from_voxels(voxelize(builtin_surface("bar"), 16))
    >>> young = np.full(mesh.n_cells, 1e9)
    >>> coarse = build_model(mesh, young, make_coarsening("average"))
    >>> found = solver.solve(coarse, modes=30, method="slepc")
    >>> two_grid = TwoGrid(fine_model(mesh, young))
    >>> blocks = blocks_from_mesh(mesh)
    >>> estimate = estimate_errors(two_grid, blocks, coarse, found.eigenvalues, found.modes)
    >>> estimate.errors.last, estimate.errors.rms > 0.1
    (30, True)
    """
    elastic = np.ascontiguousarray(modes[:, RIGID_MODES:MODES_USED])
    exact, vectors = two_grid.lowest(blocks, elastic)
    count = min(len(exact), LAST - RIGID_MODES)
    exact, vectors = exact[:count], vectors[:, :count]
    ratio = np.maximum(values[RIGID_MODES : RIGID_MODES + count], 0.0) / exact
    errors = np.sqrt(ratio) - 1.0
    shares = error_shares(blocks, coarse, two_grid.fine, exact, vectors)
    return ErrorEstimate(ExpectedErrors(errors), np.sqrt(np.mean(shares**2, axis=1)))


def error_shares(
    blocks: Blocks, coarse: ElasticModel, fine: ElasticModel, values: Array, vectors: Array
) -> Array:
    """Share (mc, k) that each element has in the relative errors of each mode's eigenvalue.

    Positive where the element is too stiff, 0 for fine cells.

    Parameters
    ----------
    blocks, coarse, fine
        The coarse mesh, plain or mixed, the model on it, and the fine one.
    values, vectors
        (k,) eigenvalues and (n_dofs, k) mass-normalised modes of the fine solid.
    """
    nearest = _nearest(blocks, coarse, fine, vectors)
    missed = element_energies(coarse, nearest) - fine_energies(blocks, fine, vectors)
    return np.where(blocks.is_fine[:, None], 0.0, missed / values)


def _nearest(blocks: Blocks, coarse: ElasticModel, fine: ElasticModel, vectors: Array) -> Array:
    """Displacements (coarse n_dofs, k) whose interpolation is nearest in the norm of the mass."""
    interpolation = prolongation(blocks)
    projected = interpolation.T @ (nodal_mass_matrix(fine) @ vectors.reshape(fine.mesh.n_nodes, -1))
    # Summed over elements: hinges, which the interpolation closes, can leave P^T M P singular.
    consistent = nodal_mass_matrix(replace(coarse, lumped=False, lumped_share=0.0))
    solved = splu(consistent.tocsc()).solve(projected)
    return np.ascontiguousarray(solved.reshape(coarse.n_dofs, -1))


def nodal_mass_matrix(model: ElasticModel) -> sp.csr_matrix:
    """Mass matrix (n, n) [kg], the same for each displacement component."""
    cells = model.mesh.cells
    rows, columns = np.repeat(cells, 8, axis=1).ravel(), np.tile(cells, (1, 8)).ravel()
    blocks = model.nodal_mass().reshape(-1, 1, 1)
    return sum_blocks(rows, columns, blocks, (model.mesh.n_nodes,) * 2)
