"""Models that are refined where it matters until the expected error is small enough.

Of coarse ones the worst blocks stay fine.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol, TypeVar

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from carillon.fem.geometry import Blocks, HexMesh, blocks_from_mesh, blocks_with_coarse
from carillon.fem.model import Constants, ElasticModel, Solid
from solver.analysis.modes import Modes
from solver.coarsening.coarsening import Coarsening
from solver.coarsening.model import coarse_model, element_moduli
from solver.distribution.collective import bcast_from_root
from solver.refinement.errors import ExpectedErrors
from solver.refinement.estimate import MODES_USED, ErrorEstimate, estimate_errors
from solver.refinement.two_grid import TwoGrid

Array = NDArray[np.float64]
Model = TypeVar("Model", bound=Solid)
Refined = TypeVar("Refined", bound=Solid, covariant=True)

REMAINING = 0.6
"""Share of the allowed error that elements are refined to in a step, if shares were errors."""

HASTE = 0.85
"""What that is multiplied by from step to step, so that they end."""


@dataclass(frozen=True)
class RefinementStep:
    """A model that was tried.

    Attributes
    ----------
    unknowns
        Of the model.
    refined
        Number of its blocks that stay fine, or of its cells that are divided.
    errors
        That its frequencies are expected to have.
    """

    unknowns: int
    refined: int
    errors: ExpectedErrors


class Refinable(Protocol[Refined]):
    """A model that can be refined where it needs to be."""

    @property
    def model(self) -> Refined:
        """The model as it is now."""

    def advance(self, values: Array, modes: Array, tolerance: float) -> tuple[RefinementStep, bool]:
        """Rate the model by its eigenvalues (k,) and modes (n_dofs, k), and refine it.

        Returns
        -------
        tuple[RefinementStep, bool]
            What was rated, and whether the model stays as it is: its errors are within `tolerance`,
            or refining it is not the way to get them there.
        """


class RefinedModel:
    """A coarse model and which of its blocks stay fine.

    Parameters
    ----------
    fine
        The fine model, with one modulus a cell.
    coarsening
        Of the blocks that do not stay fine.
    mesh
        Coarse mesh to begin with, perhaps mixed; the plain one if it is none of this fine mesh.
    threads
        Threads for products with blocks of vectors.
    """

    def __init__(
        self,
        fine: ElasticModel,
        coarsening: Coarsening,
        mesh: HexMesh | None = None,
        threads: int = 1,
    ) -> None:
        self._young = fine.young[:, 0]
        self._coarsening = coarsening
        self._constants: Constants = {
            "poisson": fine.poisson,
            "density": fine.density,
            "lumped": fine.lumped,
        }
        self._plain = blocks_from_mesh(fine.mesh)
        given = None if mesh is None else blocks_with_coarse(fine.mesh, mesh)
        self.blocks = self._plain if given is None else given
        self._two_grid = TwoGrid(fine, threads)
        self._steps = 0

    @property
    def model(self) -> ElasticModel:
        """The model as it is now."""
        moduli = element_moduli(self.blocks, self._young, self._coarsening)
        fraction = self._coarsening.lumped_fraction
        return coarse_model(self.blocks, moduli, fraction, **self._constants)

    @property
    def fine_blocks(self) -> int:
        """Number of blocks that stay fine."""
        cells = self.blocks.coarse.grid[self.blocks.is_fine] >> 1
        return len(np.unique(cells, axis=0))

    def advance(self, values: Array, modes: Array, tolerance: float) -> tuple[RefinementStep, bool]:
        """See `Refinable.advance`."""
        estimate = estimate_errors(self._two_grid, self.blocks, self.model, values, modes)
        step = RefinementStep(self.blocks.coarse.n_dofs, self.fine_blocks, estimate.errors)
        done = estimate.errors.excess(tolerance) <= 1.0
        if not done:
            self._refine(estimate, tolerance)
        return step, done

    def _refine(self, estimate: ErrorEstimate, tolerance: float) -> None:
        """Keep fine the elements with the largest shares of an error above `tolerance`."""
        order = np.argsort(-estimate.shares, kind="stable")
        left = REMAINING * HASTE**self._steps / estimate.errors.excess(tolerance)
        reached = np.cumsum(estimate.shares[order])
        count = 1 + int(np.searchsorted(reached, (1.0 - left) * reached[-1]))
        self.blocks = self._with_fine(order[:count])
        self._steps += 1

    def _with_fine(self, chosen: NDArray[np.int64]) -> Blocks:
        """The blocks with other elements fine beside those that are."""
        now, plain = self.blocks, self._plain
        fine = now.is_fine.copy()
        fine[chosen] = True
        cells = np.zeros(now.fine.n_cells, dtype=bool)
        cells[now.fine_of_block[fine][now.mask[fine]]] = True
        return blocks_from_mesh(now.fine, (cells[plain.fine_of_block] & plain.mask).any(axis=1))


def solve_refined(
    solve: Callable[[Model | None], Modes],
    refined: Refinable[Model] | None,
    tolerance: float,
    comm: MPI.Comm = MPI.COMM_WORLD,
    report: Callable[[RefinementStep], None] | None = None,
) -> tuple[Model | None, Modes, list[RefinementStep]]:
    """Solve, estimate and refine until the expected error is at most `tolerance`; collective.

    Parameters
    ----------
    solve
        Finds the modes of a model, which is None but on rank 0.
    refined
        On rank 0, which estimates; None on the others.
    tolerance
        For the root mean square of the relative errors of frequencies 7 to 60; the worst may be
        three times as large.
    report
        Called on rank 0 after each step.

    Returns
    -------
    tuple[Model | None, Modes, list[RefinementStep]]
        The last model, on rank 0; its modes, and the steps.

    Examples
    --------
    >>> from carillon.fem.geometry import builtin_surface, hexmesh_from_voxels, voxelize
    >>> from carillon.fem.model import fine_model
    >>> from solver import SolverOptions
    >>> from solver.analysis.modal_solver import modal_analysis
    >>> from solver.coarsening.choice import make_coarsening
    >>> mesh = hexmesh_from_voxels(voxelize(builtin_surface("fork"), 24))
    >>> fine = fine_model(mesh, np.full(mesh.n_cells, 1e9))
    >>> start = RefinedModel(fine, make_coarsening("ddfem"))
    >>> how = SolverOptions(method="slepc", modes=30)
    >>> model, modes, steps = solve_refined(lambda model: modal_analysis(model, how), start, 0.03)
    >>> steps[0].errors.rms > 0.03 >= steps[-1].errors.rms, model.n_dofs < fine.n_dofs
    (True, True)
    """
    steps: list[RefinementStep] = []
    while True:
        model = None if refined is None else refined.model
        modes = solve(model)
        gathered = modes.system.gather(np.ascontiguousarray(modes.vectors[:, :MODES_USED]))

        step, done = bcast_from_root(comm, partial(_advance, refined, modes, gathered, tolerance))
        steps.append(step)
        if report is not None and comm.rank == 0:
            report(step)
        if done:
            return model, modes, steps
        modes.destroy()


def _advance(
    refined: Refinable[Any] | None, modes: Modes, gathered: Array | None, tolerance: float
) -> tuple[RefinementStep, bool]:
    assert refined is not None and gathered is not None
    return refined.advance(modes.values[:MODES_USED], gathered, tolerance)
