"""Spectra of a solid coarsened by every fit objective, against the fine one: which fit is best.

And by forests, which have learned one of the fits: what is lost by that.
"""

import logging
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, cast

import numpy as np

from carillon.arrays import Array
from carillon.command_line.progress import track
from carillon.errors import ConvergenceError
from carillon.fem.geometry import Blocks, blocks_from_mesh
from carillon.fem.model import RIGID_MODES, ElasticModel, Solid
from carillon.processes.mpi import MPI
from solver.analysis.modal_solver import modal_analysis
from solver.analysis.modes import Modes
from solver.analysis.options import SolverOptions
from solver.analysis.problem import Problem, ProblemOptions, build_problem
from solver.coarsening.choice import FitCoarsening, LinearCoarsening
from solver.coarsening.coarsening import Coarsening
from solver.coarsening.forest import FOREST, ForestCoarsening, forest_or_reason
from solver.coarsening.model import block_moduli, coarse_model
from solver.distribution.collective import bcast_from_root, compute_on_root
from solver.files.modes_file import CHECKS, frequencies
from solver.verification.matching import AUDIBLE_LAST, frequency_errors

logger = logging.getLogger(__name__)


BASELINES = ("galerkin", "average")
"""Coarsenings without a fit, which every objective is to beat."""


def rate_objectives(
    options: ProblemOptions,
    modes: int,
    objectives: Sequence[str],
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> dict[str, Any]:
    """Frequency errors of one solid coarsened by each objective, by forests and by the baselines.

    The coarse moduli of an objective are the fits themselves, block by block; those of `ddfem` are
    from `options.forest` or the default forests, which are left out if they are absent or for
    another Poisson's ratio.  All coarse models have the same mesh; they and the fine one are
    solved by SLEPc.

    Returns plain values: sizes, `forest` (which; None without, then `without_forest` says why),
    `truth` (evidence, seconds, frequencies [Hz]) and `rows`, one a coarsening with the errors over
    modes 7..60 (`audible`) and 7..`modes` (`all`), or as many as the coarse model has.
    """
    solid = compute_on_root(comm, lambda: _read(options, objectives))
    truth = _solve(None if solid is None else solid.problem.model, modes, comm)
    exact = frequencies(truth.values)
    names = bcast_from_root(comm, lambda: list(cast(_Solid, solid).coarsenings))
    if solid is not None and solid.reason:
        logger.warning(solid.reason)
    rows = [
        _row(name, solid, exact, comm)
        for name in track(names, "coarsenings", visible=comm.rank == 0)
    ]
    return {
        "mesh": options.mesh,
        "resolution": options.resolution,
        "material": options.material,
        "seed": options.seed,
        "poisson": options.poisson,
        "modes": modes,
        **bcast_from_root(comm, lambda: _sizes(cast(_Solid, solid))),
        "truth": {
            **truth.evidence,
            "seconds": solve_seconds(truth),
            "frequencies_hz": exact.tolist(),
        },
        "rows": rows,
    }


@dataclass(frozen=True)
class _Solid:
    """The solid to coarsen, on rank 0 alone."""

    problem: Problem
    blocks: Blocks
    e: Array
    """(mc, 8) fine moduli of the blocks."""
    coarsenings: dict[str, Coarsening]
    """To rate, by the names of their rows."""
    forest: ForestCoarsening | None
    reason: str
    """The forests, or None and why."""


def _read(options: ProblemOptions, objectives: Sequence[str]) -> _Solid:
    forest, reason = forest_or_reason(options.forest, options.poisson)
    problem = build_problem(replace(options, coarsen="none"))
    blocks = blocks_from_mesh(problem.fine)
    e = block_moduli(blocks, problem.young)
    coarsenings: dict[str, Coarsening] = {
        name: FitCoarsening(name, options.poisson) for name in objectives
    }
    if forest is not None:
        coarsenings[FOREST] = forest
    coarsenings |= {name: LinearCoarsening(name) for name in BASELINES}
    return _Solid(problem, blocks, e, coarsenings, forest, reason)


def _sizes(solid: _Solid) -> dict[str, Any]:
    return {
        "n_dofs": solid.problem.model.n_dofs,
        "coarse_n_dofs": 3 * solid.blocks.coarse.n_nodes,
        "blocks": len(solid.e),
        "distinct_blocks": len(np.unique(solid.e, axis=0)),
        "forest": None if solid.forest is None else solid.forest.record(),
        "without_forest": solid.reason,
    }


def solve_seconds(result: Modes) -> float:
    """Wall time [s] from the model to its modes, without the checks."""
    return sum(seconds for phase, seconds in result.seconds.items() if phase not in CHECKS)


def _solve(model: Solid | None, modes: int, comm: MPI.Comm) -> Modes:
    result = modal_analysis(model, SolverOptions(method="slepc", modes=modes), comm)
    result.system.destroy()
    return result


def _coarsen(name: str, solid: _Solid) -> tuple[ElasticModel, float, float | None]:
    """A coarse model, the seconds its material took, and the share of fits that converged."""
    fine, coarsening = solid.problem.hexahedra, solid.coarsenings[name]
    # Compiling, or loading what was compiled, is not part of fitting.
    _moduli(coarsening, solid.e[:1])
    begin = time.perf_counter()
    moduli, converged = _moduli(coarsening, solid.e)
    fitted = time.perf_counter() - begin
    model = coarse_model(solid.blocks, moduli, coarsening.lumped_fraction, **fine.constants)
    return model, fitted, converged


def _row(name: str, solid: _Solid | None, exact: Array, comm: MPI.Comm) -> dict[str, Any]:
    coarse = compute_on_root(comm, lambda: _coarsen(name, cast(_Solid, solid)))
    model = None if coarse is None else coarse[0]
    modes, fitted, converged = comm.bcast(
        coarse and (min(len(exact), coarse[0].n_dofs), *coarse[1:])
    )
    try:
        result = _solve(model, modes, comm)
    except ConvergenceError as error:
        raise ConvergenceError(f"{name}: {error}") from None
    hertz = frequencies(result.values)
    errors = hertz[RIGID_MODES:] / exact[RIGID_MODES : len(hertz)] - 1.0
    return {
        "coarsening": name,
        "audible": asdict(frequency_errors(errors, AUDIBLE_LAST)),
        "all": asdict(frequency_errors(errors, len(hertz))),
        "converged": converged,
        "fit_seconds": fitted,
        "solve_seconds": solve_seconds(result),
        "frequencies_hz": hertz.tolist(),
    }


def _moduli(coarsening: Coarsening, e: Array) -> tuple[Array, float | None]:
    """Coarse moduli and the share of blocks whose fit converged, None without a fit."""
    if isinstance(coarsening, FitCoarsening):
        fits = coarsening.fits(e)
        return fits.moduli, float(fits.converged.mean())
    return coarsening.moduli(e), None
