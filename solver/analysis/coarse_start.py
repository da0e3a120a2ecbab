"""Modes of the coarsened solid on its fine mesh, as a start for those of the fine solid."""

from collections.abc import Iterator

import numpy as np
import scipy.sparse as sp

from carillon.arrays import Array
from carillon.errors import UserError
from carillon.fem.geometry import Blocks, blocks_from_mesh, prolongation
from carillon.fem.model import ElasticModel, Solid
from solver.analysis.modal_solver import ModalSolver
from solver.analysis.options import SolverOptions
from solver.coarsening.coarsening import Coarsening
from solver.coarsening.model import coarse_model, element_moduli
from solver.correction.criteria import default_guard
from solver.correction.random_start import Approximation
from solver.distribution.collective import compute_on_root
from solver.files.initial_modes import COLUMNS, scatter_rows

TOLERANCE = 1e-3
"""Relative eigenvalue error of the coarse modes: less than what coarsening adds."""


def coarse_start(
    solver: ModalSolver, model: Solid | None, coarsening: Coarsening | None
) -> Approximation:
    """Modes of the 2x2x2 blocks of a fine model, prolonged to its nodes; collective.

    Rank 0 has the fine `model`, of voxels with one modulus each, and what makes coarse elements of
    its blocks. Raises UserError for a model that is not coarsened, or too few coarse unknowns.
    """
    comm = solver.comm
    coarsened = compute_on_root(comm, lambda: _coarsened(model, coarsening))
    blocks, coarse = (None, None) if coarsened is None else coarsened
    requested = solver.options.modes
    options = SolverOptions(
        modes=requested + default_guard(requested), tolerance=TOLERANCE, seed=solver.options.seed
    )
    modes = ModalSolver(coarse, options, comm, once=True).solve()
    whole = modes.system.gather(modes.vectors[:, modes.rigid :])
    values = modes.values[modes.rigid :]
    modes.destroy()
    mesh = solver.local_mesh

    def rows() -> Array:
        return scatter_rows(prolonged(blocks, whole), len(values), mesh, comm)

    return Approximation(values, rows)


def _coarsened(model: Solid | None, coarsening: Coarsening | None) -> tuple[Blocks, ElasticModel]:
    """Blocks of a model of voxels, and the coarse model of them."""
    assert model is not None and coarsening is not None
    if not isinstance(model, ElasticModel) or model.mesh.span is not None or not model.filled.all():
        raise UserError(
            "--refine starts from the coarsened solid; expected voxels that are not coarsened"
        )
    blocks = blocks_from_mesh(model.mesh)
    moduli = element_moduli(
        blocks, model.young[:, 0], coarsening, model.regions, model.cell_regions
    )
    coarse = coarse_model(
        blocks,
        moduli,
        coarsening.lumped_fraction,
        model.cell_regions,
        **model.constants,
    )
    return blocks, coarse


def prolonged(blocks: Blocks | None, modes: Array | None) -> Iterator[Array]:
    """Coarse modes (coarse n_dofs, k) on the fine nodes (n_dofs, c), a few at a time.

    Nothing on ranks that do not have them.
    """
    if blocks is None or modes is None:
        return
    interpolation = sp.kron(prolongation(blocks), sp.identity(3), format="csr")
    for first in range(0, modes.shape[1], COLUMNS):
        yield interpolation @ np.ascontiguousarray(modes[:, first : first + COLUMNS])
