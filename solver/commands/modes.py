"""Compute the lowest modes of a solid and write them to a file.

It may be started on several ranks, with the same result:
mpiexec -n RANKS python -m mpi4py -m solver modes ...
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon.options import add_options, collect
from carillon.progress import say
from solver.analysis.modal_solver import ModalSolver, Modes
from solver.analysis.options import SolverOptions
from solver.analysis.problem import Problem, ProblemOptions, build_problem
from solver.commands.running import add_solid, on_ranks, parameters, require_outputs
from solver.distribution.collective import compute_on_root
from solver.files.initial_modes import modes_from_file
from solver.files.modes_file import frequencies, write_modes
from solver.linear import petsc_options

EXAMPLES = """examples:
  modes builtin:bell --resolution 32 --out bell.h5
  modes bunny.obj --resolution 48 --material two-region --coarsen ddfem --modes 60 --out bunny.h5
  modes bunny.obj --resolution 48 --method slepc --modes 60 --out truth.h5
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_solid(parser)
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
        problem = compute_on_root(comm, lambda: build_problem(described))
        model = None if problem is None else problem.model
        petsc_options.insert_options(arguments.petsc, options.method)
        prepared = ModalSolver(model, options, comm, verbose=sys.stderr.isatty())
        initial_modes = None
        if arguments.initial_modes is not None:
            initial_modes = modes_from_file(
                arguments.initial_modes, model, options.modes, prepared.local_mesh, comm
            )
        result = prepared.solve(initial_modes=initial_modes)
        result.seconds = {**prepared.seconds, **result.seconds}
        attributes = {} if problem is None else _attributes(arguments, problem, result)

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


def _warn_about_options() -> None:
    unused = petsc_options.unused_options()
    if unused:
        say(f"warning: PETSc had no use for {', '.join(unused)}; see whether the names are right")


def _attributes(arguments: argparse.Namespace, problem: Problem, result: Modes) -> dict[str, Any]:
    attributes: dict[str, Any] = {
        "method": arguments.method,
        "coarsen": arguments.coarsen,
        "mesh": arguments.mesh,
        "resolution": arguments.resolution,
        "material": arguments.material,
        "seed": arguments.seed,
        "interface": arguments.interface,
        "fine_n_dofs": problem.fine.n_dofs,
        **problem.coarsening,
        **result.evidence,
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
