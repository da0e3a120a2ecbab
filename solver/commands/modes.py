"""Compute the lowest modes of a solid and write them to a file.

It may be started on several ranks, with the same result:
mpiexec -n RANKS python -m mpi4py -m solver modes ...
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon.command_line.progress import say
from carillon.errors import UserError, on_all_ranks
from carillon.fem.geometry.size import sizes_in_words
from carillon.fem.model import Solid
from carillon.parameters.command_line import add_options, collect, reader
from carillon.parameters.quantities import Resolution
from solver.accuracy.options import FIRST_RESOLUTION, DistanceOptions
from solver.accuracy.solving import Wishes, solve_accurately, solve_solid
from solver.analysis.coarse_start import coarse_start
from solver.analysis.modal_solver import ModalSolver
from solver.analysis.modes import Initial, Modes
from solver.analysis.options import SolverOptions
from solver.analysis.problem import Problem, ProblemOptions
from solver.coarsening.choice import make_coarsening
from solver.coarsening.coarsening import Coarsening
from solver.coarsening.forest import forest_or_reason
from solver.commands.running import add_solid, on_ranks, parameters, require_outputs
from solver.distribution.collective import compute_on_root
from solver.files.initial_modes import modes_from_file
from solver.files.modes_file import ESTIMATE, FINE_TAKEN, frequencies, write_modes
from solver.linear import petsc_options
from solver.refinement.coarse_or_fine import FineStart
from solver.refinement.errors import FROM_FINE, FROM_SOLID, in_words
from solver.refinement.options import RefinementOptions
from solver.refinement.refine import RefinementStep

EXAMPLES = """examples:
  modes builtin:bell --resolution 32 --out bell.h5
  modes bunny.obj --resolution 48 --material two-region --coarsen ddfem --modes 60 --out bunny.h5
  modes bunny.obj --resolution 48 --method slepc --modes 60 --out truth.h5
"""

ESTIMATE_TOLERANCE = 1e-4
"""Relative error of the eigenvalues that voxels are compared with."""
REFINED = {"fine_blocks": "blocks fine", "divided_cells": "cells divided"}
EXPECTED = {FROM_FINE: "error against the voxels", FROM_SOLID: "distance from the solid"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_solid(parser, "resolution")
    parser.add_argument(
        "--resolution",
        type=reader(Resolution),
        help="voxels, or lattice spacings, along the longest side; needed without --accuracy",
    )
    add_options(parser, DistanceOptions)
    add_options(parser, RefinementOptions)
    add_options(parser, SolverOptions, leave_out=("seed",))
    parser.add_argument("--out", required=True, help="modes file to write (HDF5)")
    parser.add_argument(
        "--initial-modes", metavar="MODES", help="modes file of a similar material to start from"
    )
    parser.add_argument(
        "--refine",
        action="store_true",
        help="start from the modes of the coarsened solid (by forests, or Galerkin's without)",
    )
    parser.add_argument(
        "--petsc",
        metavar="OPTIONS",
        help='options for PETSc and SLEPc with the prefix carillon_, as in "-carillon_eps_ncv 400"',
    )
    parser.add_argument("--json", action="store_true", help="print a summary as JSON")


def run(arguments: argparse.Namespace) -> None:
    """Build the solid, solve, verify, write."""
    with on_ranks(arguments.petsc) as comm:
        require_outputs(arguments, comm)
        accuracy = collect(DistanceOptions, arguments)
        arguments.resolution = _resolution(arguments)
        described = collect(ProblemOptions, arguments)
        options = collect(SolverOptions, arguments)
        refine_to = collect(RefinementOptions, arguments).tolerance(
            described.coarsen, described.discretisation, accuracy.estimate is not False
        )
        petsc_options.insert_options(arguments.petsc, options.method)
        initial = arguments.initial_modes
        coarsening = compute_on_root(comm, lambda: _coarsening(arguments, described))

        def solve(
            model: Solid | None, modes: int | None = None, start: FineStart | None = None
        ) -> Modes:
            nonlocal initial
            asked = options if modes is None else _for_estimate(options, modes)
            analysed = None if start is None else start.prepared
            prepared = ModalSolver(model, asked, comm, sys.stderr.isatty(), analysed)
            begin: Initial | None = None
            if initial is not None:
                begin = modes_from_file(initial, model, asked.modes, prepared.local_mesh, comm)
                initial = None
            elif start is not None:
                begin = start.begin(prepared)
            elif arguments.refine and modes is None:  # the cells of an estimate are no voxels
                begin = coarse_start(prepared, model, coarsening)
            result = prepared.solve(initial_modes=begin)
            result.seconds = {**prepared.seconds, **result.seconds}
            return result

        begin = time.perf_counter()
        estimated = accuracy.is_estimated(described, options)
        wishes = Wishes(refine_to, estimated, initial, options)
        if accuracy.accuracy is None:
            solved = solve_solid(described, solve, wishes, comm, _report)
        else:
            described, solved = solve_accurately(
                described, accuracy.accuracy, solve, wishes, comm, _report
            )
            arguments.resolution = described.resolution
        arguments.coarsen = described.coarsen
        problem, model, result = solved.problem, solved.model, solved.modes
        attributes: dict[str, Any] = {}
        if problem is not None:
            if solved.achieved:
                # What was solved on the way, and estimated.
                told = sum(problem.seconds.values()) + sum(result.seconds.values())
                rest = max(time.perf_counter() - begin - told, 0.0)
                refined = refine_to is not None or accuracy.accuracy is not None
                result.seconds["refinement" if refined else ESTIMATE] = rest
            attributes = _attributes(arguments, problem, result, solved.achieved)

        def write(blocks: Iterator[NDArray[np.float64]]) -> None:
            assert model is not None
            write_modes(
                arguments.out,
                model,
                result.values,
                blocks,
                result.residuals,
                attributes,
                parameters(arguments),
            )

        result.system.stream_to_root(result.vectors, write)
        if comm.rank == 0:
            assert problem is not None
            _warn_about_options()
            _print_summary(attributes, problem, result.values, arguments)


def _coarsening(arguments: argparse.Namespace, described: ProblemOptions) -> Coarsening | None:
    """What makes the coarse solid to start from."""
    if not arguments.refine:
        return None
    if described.coarsen != "none" or described.discretisation != "voxel":
        raise UserError("--refine starts from the coarsened solid: expected voxels, --coarsen none")
    if arguments.initial_modes is not None:
        raise UserError("--refine makes the modes to start from: leave out --initial-modes")
    forest, _ = forest_or_reason(described.forest, described.poisson)
    return forest or make_coarsening("galerkin")


def _for_estimate(options: SolverOptions, modes: int) -> SolverOptions:
    """For few modes at most, no nearer than an estimate of errors needs them."""
    asked = replace(options, modes=min(modes, options.modes))
    if options.is_general or options.tolerance == 0.0:
        return asked
    tolerance = max(options.tolerance or 0.0, ESTIMATE_TOLERANCE)
    # How it is solved is not asked, and incomplete factors are none for cells cut by a surface.
    direct = options.linear_solver == "icc-pcg"
    return SolverOptions(
        method="auto",
        modes=asked.modes,
        tolerance=tolerance,
        seed=options.seed,
        linear_solver="auto" if direct else options.linear_solver,
    )


@on_all_ranks()
def _resolution(arguments: argparse.Namespace) -> int:
    if arguments.resolution is not None:
        return int(arguments.resolution)
    if arguments.accuracy is None:
        raise UserError("expected --resolution, or --accuracy to choose one")
    return FIRST_RESOLUTION


def _report(what: str, step: RefinementStep) -> None:
    errors = step.errors
    say(
        f"{step.unknowns:,} unknowns, {step.refined:,} {REFINED[what]}: frequencies are expected "
        f"to be {errors.rms:.1%} off, mode {errors.worst_mode} {errors.worst:+.1%}",
        visible=sys.stderr.isatty(),
    )


def _warn_about_options() -> None:
    unused = petsc_options.unused_options()
    if unused:
        say(f"warning: PETSc had no use for {', '.join(unused)}; see whether the names are right")


def _attributes(
    arguments: argparse.Namespace, problem: Problem, result: Modes, achieved: dict[str, Any]
) -> dict[str, Any]:
    attributes: dict[str, Any] = {
        "method": arguments.method,
        "discretisation": arguments.discretisation,
        "coarsen": arguments.coarsen,
        "mesh": arguments.mesh,
        "resolution": arguments.resolution,
        "material": arguments.material,
        "seed": arguments.seed,
        "interface": arguments.interface,
        "fine_n_dofs": problem.fine.n_dofs,
        **problem.coarsening,
        **result.evidence,
        **achieved,
        "timings": {**problem.seconds, **result.seconds},
    }
    if arguments.tolerance is not None:
        attributes["tolerance"] = arguments.tolerance
    return attributes


def _print_summary(
    attributes: dict[str, Any],
    problem: Problem,
    values: NDArray[np.float64],
    arguments: argparse.Namespace,
) -> None:
    hertz = frequencies(values)
    if arguments.json:
        found = {
            "extents_m": problem.extents,
            "voxel_extents_m": problem.voxel_extents,
            "frequencies_hz": hertz.tolist(),
        }
        summary = {**attributes, **found, "out": arguments.out}
        print(json.dumps(summary))
        return
    total = sum(attributes["timings"].values())
    elastic = hertz[6:]
    span = f"{elastic[0]:.2f} to {elastic[-1]:.2f} Hz" if len(elastic) else "none elastic"
    added = attributes.get("modes_added", 0)
    late = f", {added} found after the first search" if added else ""
    print(
        f"{arguments.out}: {len(values)} modes of {attributes['n_dofs']:,} unknowns, {span}{late}; "
        f"{sizes_in_words(problem.extents, problem.voxel_extents)}; "
        f"{attributes['rigid_modes']} rigid, largest 2-norm residual "
        f"{attributes['residual_max']:.1e}, orthogonal to {attributes['orthogonality']:.1e}, "
        f"{total:.1f} s on {attributes['ranks']} rank{'s' if attributes['ranks'] > 1 else ''}"
    )
    if "missed_tolerance" in attributes:
        print(
            f"tolerance missed: {attributes['corrections']} corrections reached an eigenvalue "
            f"error of {attributes['eigenvalue_error_estimate']:.1e}, "
            f"{attributes['missed_tolerance']:.1e} was asked for"
        )
    if FINE_TAKEN in attributes:
        print(f"the fine solid was solved: {attributes[FINE_TAKEN]}")
        attributes = {k: v for k, v in attributes.items() if not k.startswith(FROM_FINE)}
    for prefix, words in EXPECTED.items():
        if f"{prefix}_rms" in attributes:
            print(f"expected {words} {in_words(attributes, prefix)}{_refined_in_words(attributes)}")
    if "missed_accuracy" in attributes:
        print(
            f"{100 * attributes['missed_accuracy']:g}% rms was aimed at, which dividing some cells "
            "does not reach: raise --resolution"
        )


def _refined_in_words(attributes: dict[str, Any]) -> str:
    return "".join(
        f"; {attributes[what]:,} {words}" for what, words in REFINED.items() if what in attributes
    )
