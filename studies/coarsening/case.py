"""One solid coarsened, plainly and with blocks that stay fine, against its exact modes."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from carillon.arrays import Array
from carillon.errors import ConvergenceError, UserError
from carillon.fem.geometry import Blocks, prolongation
from carillon.fem.model import ElasticModel
from carillon.processes.mpi import MPI
from solver.analysis.modal_solver import modal_analysis
from solver.analysis.modes import Modes
from solver.analysis.options import SolverOptions
from solver.analysis.problem import Problem, ProblemOptions, build_problem
from solver.files.modes_file import CHECKS, frequencies
from solver.refinement.errors import LAST, WORST
from solver.refinement.estimate import MODES_USED, estimate_errors
from solver.refinement.inverse_iteration import InverseIteration
from solver.refinement.refined_model import RefinedModel
from studies.coarsening.costs import Taken, as_values, compare_costs, take, timed
from studies.coarsening.picture_file import ModePicture
from studies.coarsening.rating import FAR_OFF, CoarseRating, SolvedModel

SPARE = MODES_USED - LAST
"""Modes found beyond those that are rated, which may be among them in truth."""

PICTURES = 4
"""Modes that are drawn, if so many are far off."""


@dataclass(frozen=True)
class RatedCase:
    """Plain values for a file; the fine solid, and its modes that the plain model gets wrong."""

    values: dict[str, Any]
    problem: Problem
    pictures: list[ModePicture]


@dataclass(frozen=True)
class _Rated:
    """A model whose modes are rated, and what is expected of them."""

    blocks: Blocks
    solution: SolvedModel
    expected: Array
    described: dict[str, Any]


def rate_coarsening(
    options: ProblemOptions, modes: int, tolerance: float, timed_modes: int | None = None
) -> RatedCase:
    """Errors of the single modes of one solid's coarse models, true and expected ones.

    The coarse model as it is, and what is taken for an expected error of at most `tolerance` where
    SLEPc finds the modes: the same, one with some blocks fine, or the fine solid. What the default
    method takes, and costs, is told beside it. All of it runs on this rank alone.

    Raises UserError for anything wrong with the solid, or if it has too few unknowns.

    Parameters
    ----------
    options
        The solid and its coarsening.
    modes
        Number of the last mode rated, the six rigid ones included; at most `LAST`.
    timed_modes
        Number of modes computed where the coarse model is chosen and timed; `modes` if not given.
    """
    coarsening = options.coarsening()
    if coarsening is None:
        raise UserError("nothing is coarsened: choose a coarsening other than none")
    problem = build_problem(replace(options, coarsen="none"))
    if problem.model.supports is not None:
        raise UserError("the solid is held; coarse models are rated on free ones, so leave it free")
    fine = problem.hexahedra
    exact, fine_cost = timed(lambda: _solve(fine, modes + SPARE))
    truth = SolvedModel(fine, exact.values, _gathered(exact))
    taken, cost = timed(lambda: take(fine, coarsening, tolerance, _slepc(fine, modes + SPARE)))
    costs = {
        "auto": compare_costs(fine, coarsening, tolerance, timed_modes or modes),
        "slepc": as_values(modes + SPARE, taken, fine_cost, cost),
    }
    rated = {
        "plain": _plain(RefinedModel(fine, coarsening), modes),
        "refined": _taken(taken, truth),
    }
    ratings = {
        name: CoarseRating(truth, each.blocks, each.solution, each.expected, modes)
        for name, each in rated.items()
    }
    values = {
        "mesh": options.mesh,
        "resolution": options.resolution,
        "material": options.material,
        "seed": options.seed,
        "poisson": options.poisson,
        "modes": modes,
        "coarsen": options.coarsen,
        **coarsening.record(),
        "goals": {"rms": tolerance, "worst": WORST * tolerance, "far_off": FAR_OFF},
        "n_dofs": fine.n_dofs,
        "cells": problem.fine.n_cells,
        "truth": {
            **exact.evidence,
            "seconds": sum(each for name, each in exact.seconds.items() if name not in CHECKS),
            "frequencies_hz": frequencies(exact.values)[:modes].tolist(),
        },
        "costs": costs,
        **{name: {**rated[name].described, **each.as_dict()} for name, each in ratings.items()},
    }
    exact.destroy()
    return RatedCase(values, problem, ratings["plain"].pictures(PICTURES))


def _plain(refined: RefinedModel, modes: int) -> _Rated:
    """A coarse model as it is, rated whether that would be worth it or not."""
    found = _solve(refined.model, modes + SPARE)
    solid = InverseIteration(refined.fine, MPI.COMM_SELF)
    expected = estimate_errors(solid, refined.blocks, found).errors.errors
    solution = SolvedModel(refined.model, found.values, _gathered(found))
    solid.destroy()
    found.destroy()
    return _Rated(refined.blocks, solution, expected, _described(refined))


def _taken(taken: Taken, truth: SolvedModel) -> _Rated:
    """What was taken: a coarse model, or the fine one, whose modes are the truth."""
    refined, found = taken.refined, taken.found
    if found.reason is None:
        solution = SolvedModel(refined.model, found.modes.values, _gathered(found.modes))
        assert found.errors is not None  # The fine solid was solved before, and can be rated by.
        expected = found.errors.errors
    else:
        refined.refine_all()
        # As many coarse nodes as fine ones, in another order.
        nodal = prolongation(refined.blocks).T @ truth.vectors.reshape(truth.model.mesh.n_nodes, -1)
        solution = SolvedModel(refined.model, truth.values, nodal.reshape(truth.vectors.shape))
        expected = np.zeros(len(truth.values))
    found.modes.destroy()
    return _Rated(refined.blocks, solution, expected, _described(refined))


def _described(refined: RefinedModel) -> dict[str, Any]:
    return {
        "n_dofs": refined.n_dofs,
        "elements": refined.blocks.coarse.n_cells,
        "fine_blocks": refined.fine_blocks,
    }


def _solve(model: ElasticModel, modes: int) -> Modes:
    try:
        return modal_analysis(model, _slepc(model, modes), MPI.COMM_SELF)
    except ConvergenceError as error:
        raise ConvergenceError(f"{model.n_dofs:,} unknowns: {error}") from None


def _slepc(model: ElasticModel, modes: int) -> SolverOptions:
    return SolverOptions(method="slepc", modes=min(modes, model.n_dofs))


def _gathered(modes: Modes) -> Any:
    whole = modes.system.gather(modes.vectors)
    assert whole is not None
    return np.ascontiguousarray(whole)
