"""The solid of a row: meshed once, with a second material that is close to its own."""

import time
from dataclasses import dataclass, replace

from carillon.arrays import Array
from carillon.errors import UserError
from carillon.fem.geometry import Blocks, blocks_from_mesh
from carillon.fem.materials import smooth_field
from carillon.fem.model import ElasticModel, Solid
from solver.analysis.bounds import check_mode_count
from solver.analysis.problem import Problem, ProblemOptions, build_problem
from solver.coarsening.choice import make_coarsening
from solver.coarsening.forest import FOREST, ForestCoarsening, forest_or_reason
from solver.coarsening.model import block_moduli, coarse_model

CHANGE = 0.05
"""Largest relative change of a modulus between the two materials."""
_CHANGE_SEED = 1
NOT_COARSENED = "without coarse models and lumped masses: they are of voxels, not of finite cells"


@dataclass(frozen=True)
class BenchmarkSolid:
    """A meshed solid, held by rank 0 alone."""

    problem: Problem
    """The fine mesh with its material."""
    blocks: Blocks | None
    """The coarse mesh; None of finite cells, which are not coarsened."""
    changed: Array
    """(m,) moduli [Pa] that differ from the material's by a smooth field of `CHANGE`."""
    forest: ForestCoarsening | None
    reason: str
    """The forests, or None and why there are none to coarsen with."""
    seconds: dict[str, float]
    """Wall time of what needs the mesh alone."""

    @property
    def fine(self) -> Solid:
        """The fine model."""
        return self.problem.model

    def coarsened(self, method: str, changed: bool = False) -> tuple[ElasticModel, float]:
        """Model of the blocks by `average` or `ddfem`, and the seconds from fine moduli to it."""
        young = self.changed if changed else self.problem.young
        begin = time.perf_counter()
        coarsening = self.forest if method == FOREST else make_coarsening(method)
        assert coarsening is not None and self.blocks is not None
        fine = self.problem.hexahedra
        model = coarse_model(
            self.blocks,
            coarsening.moduli(block_moduli(self.blocks, young)),
            coarsening.lumped_fraction,
            regions=fine.regions,
            lumped=fine.lumped,
        )
        return model, time.perf_counter() - begin

    def lumped(self) -> ElasticModel:
        """The fine model with a diagonal mass."""
        return replace(self.problem.hexahedra, lumped=True)


def make_solid(options: ProblemOptions, modes: int) -> BenchmarkSolid:
    """Discretise the solid and give it both materials.

    Raises UserError for anything wrong with the mesh, the material or the forests, or if the fine
    or the coarse model has fewer unknowns than modes are wanted.
    """
    problem = build_problem(replace(options, coarsen="none"))
    check_mode_count(modes, problem.model.n_dofs)
    change = CHANGE * smooth_field(problem.fine, options.seed + _CHANGE_SEED)
    changed = problem.young * (1.0 + change)
    if not isinstance(problem.model, ElasticModel):
        return BenchmarkSolid(problem, None, changed, None, NOT_COARSENED, problem.seconds)
    forest, reason = forest_or_reason(options.forest, options.poisson)
    begin = time.perf_counter()
    blocks = blocks_from_mesh(problem.fine)
    blocked = time.perf_counter() - begin
    unknowns = 3 * blocks.coarse.n_nodes
    if modes > unknowns:
        raise UserError(
            f"{modes:,} modes asked for, but the coarsened model has {unknowns:,} unknowns; ask "
            "for fewer or raise --resolution"
        )
    return BenchmarkSolid(
        problem,
        blocks,
        changed,
        forest,
        reason,
        {**problem.seconds, "blocks": blocked},
    )
