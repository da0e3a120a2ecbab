"""How far off a coarse model's frequencies are, and through which elements.

`InverseIteration` gives the frequencies of the fine solid to a few tenths of what the coarse ones
miss. The coarse eigenvalue and the fine one differ by what the elements make of the same motion:
with a fine mode v and the coarse displacements u that are nearest to it (in the norm of the mass)
the strain energy of an element, u^T K_c u, ought to be that of its fine cells, v^T K v. How far it
is from that, relative to the mode's, is the element's share of the error. It tells which elements
to keep fine; the sum of the shares is not the error, since u is no coarse mode.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from carillon.arrays import Array
from carillon.fem.block import degrees_of_freedom
from carillon.fem.element import uniform_stiffness
from carillon.fem.geometry import Blocks, prolongation
from carillon.fem.model import ElasticModel
from solver.analysis.coarse_start import prolonged
from solver.analysis.modes import Modes
from solver.assembly.sparse import sum_blocks
from solver.refinement.errors import LAST, ExpectedErrors
from solver.refinement.inverse_iteration import InverseIteration, NearModes

MODES_USED = LAST + 12
"""Number of modes that are compared, since modes may change places."""
COLUMNS_USED = LAST + 2
"""Number of elastic modes that are iterated. Random vectors beside them find those that are
missing."""
NUMBERS_AT_ONCE = 1 << 22
"""Number of element displacements that exist at once."""


@dataclass(frozen=True)
class ErrorEstimate:
    """Expected errors of a coarse model's frequencies.

    They come from as many `fine` modes as are rated, or more.
    """

    errors: ExpectedErrors
    fine: NearModes


def estimate_errors(solid: InverseIteration, blocks: Blocks | None, modes: Modes) -> ErrorEstimate:
    """Expected errors of the frequencies of a coarse model, up to mode `LAST`; collective.

    Parameters
    ----------
    blocks
        The coarse mesh, plain or mixed, on rank 0; None on the others.
    modes
        Of the model on it, the six rigid ones included.

    Examples
    --------
    >>> import solver
    >>> from carillon.fem.geometry import (
    ...     blocks_from_mesh, builtin_surface, hexmesh_from_voxels, voxelize
    ... )
    >>> from carillon.fem.model import fine_model
    >>> from solver.analysis.modal_solver import modal_analysis
    >>> from solver.coarsening.choice import make_coarsening
    >>> from solver.coarsening.model import build_model
    >>> mesh = hexmesh_from_voxels(voxelize(builtin_surface("bar"), 16))
    >>> young = np.full(mesh.n_cells, 1e9)
    >>> coarse = build_model(mesh, young, make_coarsening("average"))
    >>> found = modal_analysis(coarse, solver.SolverOptions(modes=30))
    >>> solid = InverseIteration(fine_model(mesh, young))
    >>> estimate = estimate_errors(solid, blocks_from_mesh(mesh), found)
    >>> estimate.errors.last, estimate.errors.rms > 0.1
    (30, True)
    """
    values = modes.values[modes.rigid : LAST]
    start = modes.start()[:, :COLUMNS_USED]
    whole = modes.system.gather(np.ascontiguousarray(start))
    fine = solid.lowest(values, prolonged(blocks, whole), start.shape[1])
    count = min(len(values), len(fine.values))
    ratio = np.maximum(values[:count], 0.0) / fine.values[:count]
    return ErrorEstimate(ExpectedErrors(np.sqrt(ratio) - 1.0, modes.rigid), fine)


def mean_shares(
    blocks: Blocks, coarse: ElasticModel, fine: ElasticModel, values: Array, vectors: Array
) -> Array:
    """Root mean square (mc,) over modes of `error_shares`, which has the parameters."""
    shares = error_shares(blocks, coarse, fine, values, vectors)
    return np.asarray(np.sqrt(np.mean(shares**2, axis=1)))


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


def element_energies(model: ElasticModel, vectors: Array) -> Array:
    """Twice the strain energy (m, k) [J] of each element in displacements (n_dofs, k) [m]."""
    dofs = degrees_of_freedom(model.mesh.cells.astype(np.int64))
    energies = np.empty((len(dofs), vectors.shape[1]))
    alike = model.mesh.kinds is None and model.region is None and model.supports is None
    uniform = alike and bool((model.young == model.young[:, :1]).all())
    kernel = uniform_stiffness(model.regions.laws[0])
    for chosen in _chunks(len(dofs), 24 * (24 + vectors.shape[1])):
        motions = vectors[dofs[chosen]]
        if uniform:
            scale = model.mesh.edge * model.young[chosen, 0]
            energies[chosen] = (motions * (kernel @ motions)).sum(axis=1) * scale[:, None]
        else:
            energies[chosen] = (motions * (model.stiffness(chosen) @ motions)).sum(axis=1)
    return energies


def fine_energies(blocks: Blocks, fine: ElasticModel, vectors: Array) -> Array:
    """The same of the fine cells that each element of a coarse mesh holds, (mc, k)."""
    energies = element_energies(fine, vectors)
    element, position = np.nonzero(blocks.mask)
    cells = blocks.fine_of_block[element, position]
    start = np.flatnonzero(np.diff(element, prepend=-1))
    return np.asarray(np.add.reduceat(energies[cells], start, axis=0))


def _chunks(count: int, numbers: int) -> Iterator[slice]:
    step = max(1, NUMBERS_AT_ONCE // numbers)
    for first in range(0, count, step):
        yield slice(first, min(first + step, count))
