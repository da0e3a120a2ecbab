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
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon.fem.model import ElasticModel, Solid, fine_model
from carillon.options import add_options, collect
from carillon.progress import say
from solver.analysis.modal_solver import ModalSolver, Modes
from solver.analysis.options import SolverOptions
from solver.analysis.problem import Problem, ProblemOptions, build_problem
from solver.commands.running import add_solid, on_ranks, parameters, require_outputs
from solver.distribution.collective import compute_on_root
from solver.files.initial_modes import modes_from_file
from solver.files.modes_file import frequencies, read_modes, write_modes
from solver.linear import petsc_options
from solver.refinement.options import RefinementOptions
from solver.refinement.refine import RefinedModel, RefinementStep, evidence_of, solve_refined

EXAMPLES = """examples:
  modes builtin:bell --resolution 32 --out bell.h5
  modes bunny.obj --resolution 48 --material two-region --coarsen ddfem --modes 60 --out bunny.h5
  modes bunny.obj --resolution 48 --method slepc --modes 60 --out truth.h5
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_solid(parser)
    add_options(parser, RefinementOptions)
    add_options(parser, SolverOptions, leave_out=("seed",))
    parser.add_argument("--out", required=True, help="modes file to write (HDF5)")
    parser.add_argument(
        "--initial-modes", metavar="MODES", help="modes file of a similar material to start from"
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
        described = collect(ProblemOptions, arguments)
        options = collect(SolverOptions, arguments)
        tolerance = collect(RefinementOptions, arguments).tolerance(described.coarsen)
        problem = compute_on_root(comm, lambda: build_problem(described))
        petsc_options.insert_options(arguments.petsc, options.method)
        initial = arguments.initial_modes

        def solve(model: Solid | None) -> Modes:
            nonlocal initial
            prepared = ModalSolver(model, options, comm, verbose=sys.stderr.isatty())
            start = None
            if initial is not None:
                start = modes_from_file(initial, model, options.modes, prepared.local_mesh, comm)
                initial = None
            result = prepared.solve(initial_modes=start)
            result.seconds = {**prepared.seconds, **result.seconds}
            return result

        begin = time.perf_counter()
        if tolerance is None:
            model = None if problem is None else problem.model
            result, achieved = solve(model), {}
        else:
            refined = compute_on_root(comm, lambda: _refined(problem, described, initial))
            model, result, steps = solve_refined(solve, refined, tolerance, comm, _report)
            achieved = evidence_of(steps)
            spent = time.perf_counter() - begin - sum(result.seconds.values())
            result.seconds = {"refinement": spent, **result.seconds}
        attributes = {} if problem is None else _attributes(arguments, problem, result, achieved)

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
            _warn_about_options()
            _print_summary(attributes, result.values, arguments)


def _refined(
    problem: Problem | None, described: ProblemOptions, initial: str | None
) -> RefinedModel:
    """The coarse model, with those blocks fine that are so in the file to start from."""
    assert problem is not None
    coarsening = described.coarsening()
    assert coarsening is not None
    mesh = None if initial is None else read_modes(initial, with_modes=False).mesh
    coarse = problem.model
    assert isinstance(coarse, ElasticModel)
    fine = fine_model(
        problem.fine,
        problem.young,
        poisson=coarse.poisson,
        density=coarse.density,
        lumped=coarse.lumped,
    )
    return RefinedModel(fine, coarsening, mesh)


def _report(step: RefinementStep) -> None:
    say(
        f"{step.unknowns:,} unknowns, {step.fine_blocks:,} blocks fine: frequencies are expected "
        f"to be {step.rms:.1%} off, mode {step.worst_mode} {step.worst:+.1%}",
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
    attributes: dict[str, Any], values: NDArray[np.float64], arguments: argparse.Namespace
) -> None:
    hertz = frequencies(values)
    if arguments.json:
        summary = {**attributes, "frequencies_hz": hertz.tolist(), "out": arguments.out}
        print(json.dumps(summary))
        return
    total = sum(attributes["timings"].values())
    elastic = hertz[6:]
    span = f"{elastic[0]:.2f} to {elastic[-1]:.2f} Hz" if len(elastic) else "none elastic"
    added = attributes.get("modes_added", 0)
    late = f", {added} found after the first search" if added else ""
    print(
        f"{arguments.out}: {len(values)} modes of {attributes['n_dofs']:,} unknowns, {span}{late}; "
        f"{attributes['rigid_modes']} rigid, largest residual {attributes['residual_max']:.1e}, "
        f"orthogonal to {attributes['orthogonality']:.1e}, {total:.1f} s on {attributes['ranks']} "
        f"rank{'s' if attributes['ranks'] > 1 else ''}"
    )
    if "expected_frequency_error_rms" in attributes:
        first, last = attributes["expected_frequency_error_modes"]
        kept = attributes["fine_blocks"]
        print(
            f"expected error of frequencies {first} to {last}: "
            f"{attributes['expected_frequency_error_rms']:.1%} rms, worst "
            f"{attributes['expected_frequency_error_worst']:+.1%} (mode "
            f"{attributes['expected_frequency_error_worst_mode']}); "
            f"{kept:,} block{'s' if kept != 1 else ''} kept fine"
        )
