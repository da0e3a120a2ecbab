"""One solid coarsened, plainly and with blocks that stay fine, against its exact modes."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from mpi4py import MPI

from carillon.errors import ConvergenceError, UserError
from carillon.fem.geometry import Blocks
from carillon.fem.model import ElasticModel
from solver.analysis.modal_solver import modal_analysis
from solver.analysis.modes import Modes
from solver.analysis.options import SolverOptions
from solver.analysis.problem import Problem, ProblemOptions, build_problem
from solver.coarsening.coarsening import Coarsening
from solver.files.modes_file import CHECKS, frequencies
from solver.refinement.errors import LAST, WORST
from solver.refinement.estimate import MODES_USED
from solver.refinement.refine import RefinedModel, RefinementStep, solve_refined
from solver.studies.coarsening.matching import FAR_OFF
from solver.studies.coarsening.pictures import ModePicture
from solver.studies.coarsening.rating import CoarseRating, SolvedModel

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
class _Attempt:
    blocks: Blocks
    solution: SolvedModel
    seconds: dict[str, float]


class _Attempts:
    """The models that a refinement goes through, with wall seconds by phase."""

    def __init__(self, problem: Problem, coarsening: Coarsening, modes: int) -> None:
        self._modes = modes
        self._mark = time.perf_counter()
        self._refined = RefinedModel(problem.hexahedra, coarsening)
        # The fine matrices are what the estimate needs beforehand.
        self._before_estimate = self._lap()
        self.made: list[_Attempt] = []
        self.steps: list[RefinementStep] = []

    def run(self, tolerance: float) -> None:
        """Solve, estimate and refine."""
        _, last, _ = solve_refined(
            self._solve, self._refined, tolerance, MPI.COMM_SELF, self._report
        )
        last.destroy()

    def seconds(self, count: int) -> dict[str, float]:
        """Wall time of the first `count` attempts by phase."""
        made = self.made[:count]
        return {phase: sum(each.seconds[phase] for each in made) for phase in made[0].seconds}

    def _solve(self, model: ElasticModel | None) -> Modes:
        assert model is not None
        coarsening = self._lap()
        modes = _solve(model, self._modes)
        self._lap()
        solution = SolvedModel(model, modes.values, _gathered(modes))
        seconds = {"coarsening": coarsening, "solve": _solve_seconds(modes), "estimate": 0.0}
        self.made.append(_Attempt(self._refined.blocks, solution, seconds))
        self._lap()
        return modes

    def _report(self, step: RefinementStep) -> None:
        self.made[-1].seconds["estimate"] = self._lap() + self._before_estimate
        self._before_estimate = 0.0
        self.steps.append(step)

    def _lap(self) -> float:
        before, self._mark = self._mark, time.perf_counter()
        return self._mark - before


def rate_coarsening(options: ProblemOptions, modes: int, tolerance: float) -> RatedCase:
    """Errors of the single modes of one solid's coarse models, true and expected ones.

    The coarse model as it is, and the one whose worst blocks stay fine until the expected error is
    at most `tolerance`; both and the fine one are solved by SLEPc, on this rank alone.

    Parameters
    ----------
    options
        The solid and its coarsening.
    modes
        Number of the last mode rated, the six rigid ones included; at most `LAST`.

    Raises
    ------
    UserError
        For anything wrong with the solid, or if it has too few unknowns.
    """
    coarsening = options.coarsening()
    if coarsening is None:
        raise UserError("nothing is coarsened: choose a coarsening other than none")
    problem = build_problem(replace(options, coarsen="none"))
    exact = _solve(problem.hexahedra, min(modes + SPARE, problem.hexahedra.n_dofs))
    truth = SolvedModel(problem.hexahedra, exact.values, _gathered(exact))
    attempts = _Attempts(problem, coarsening, modes + SPARE)
    attempts.run(tolerance)
    count = len(attempts.made)
    ratings = {
        "plain": _rating(truth, attempts, 0, modes),
        "refined": _rating(truth, attempts, count - 1, modes),
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
        "n_dofs": problem.hexahedra.n_dofs,
        "cells": problem.fine.n_cells,
        "truth": {
            **exact.evidence,
            "seconds": _solve_seconds(exact),
            "frequencies_hz": frequencies(exact.values)[:modes].tolist(),
        },
        **{
            name: {**_described(attempts, at), **rating.as_dict()}
            for (name, rating), at in zip(ratings.items(), (0, count - 1), strict=True)
        },
    }
    exact.destroy()
    return RatedCase(values, problem, ratings["plain"].pictures(PICTURES))


def _rating(truth: SolvedModel, attempts: _Attempts, at: int, modes: int) -> CoarseRating:
    made, step = attempts.made[at], attempts.steps[at]
    return CoarseRating(truth, made.blocks, made.solution, step.errors.errors, modes)


def _described(attempts: _Attempts, at: int) -> dict[str, Any]:
    made, step = attempts.made[at], attempts.steps[at]
    return {
        "n_dofs": step.unknowns,
        "elements": made.blocks.coarse.n_cells,
        "fine_blocks": step.refined,
        "refinement_steps": at,
        "seconds": attempts.seconds(at + 1),
    }


def _solve(model: ElasticModel, modes: int) -> Modes:
    options = SolverOptions(method="slepc", modes=min(modes, model.n_dofs))
    try:
        return modal_analysis(model, options, MPI.COMM_SELF)
    except ConvergenceError as error:
        raise ConvergenceError(f"{model.n_dofs:,} unknowns: {error}") from None


def _gathered(modes: Modes) -> Any:
    whole = modes.system.gather(modes.vectors)
    assert whole is not None
    return np.ascontiguousarray(whole)


def _solve_seconds(modes: Modes) -> float:
    return sum(seconds for phase, seconds in modes.seconds.items() if phase not in CHECKS)
