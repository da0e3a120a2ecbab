"""What the solver's commands share: ranks, PETSc's errors, a measurement, outputs and origin."""

import argparse
import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

from carillon.command_line import outputs
from carillon.fem.model import Solid
from carillon.files.atomic import atomic_path
from carillon.parameters.command_line import add_options, collect
from carillon.processes.blas import warn_about_reference_blas
from carillon.processes.mpi import MPI
from carillon.records.measurement import measured
from solver.analysis.problem import ProblemOptions, build_problem
from solver.distribution.collective import bcast_from_root, share_cores
from solver.linear import petsc_options

Options = TypeVar("Options")
"""Options of a command."""

INPUTS = ("mesh", "material", "regions", "forest", "truth", "initial_modes", "files", "candidates")
"""Arguments that name input files of a command."""
HIDDEN = ("out", "pictures", "json", "phases")
"""Arguments that do not change a result."""
COMPOSED = ("regions", "fix")
"""Those of solids of several materials or held ones, for commands on free solids of one."""


@contextmanager
def on_ranks(petsc: str | None = None) -> Iterator[MPI.Comm]:
    """All ranks, with their share of the cores; what PETSc refuses of `petsc` is one sentence."""
    comm = MPI.COMM_WORLD
    share_cores(comm)
    if comm.rank == 0 and comm.size > 1:
        warn_about_reference_blas()
    try:
        yield comm
    except petsc_options.errors() as error:
        raise petsc_options.meaning(error, petsc) from error
    if comm.size == 1:  # which loads PETSc when it is needed
        warn_about_reference_blas()


WALL = ("wall", "wall_side")
"""Those of solids that are walls, for commands on what a mesh encloses."""


def add_solid(parser: argparse.ArgumentParser, *leave_out: str) -> None:
    """Add the arguments that describe a solid, some of them left out."""
    add_options(parser, ProblemOptions, leave_out, positional=("mesh",))


def add_voxels(parser: argparse.ArgumentParser, *leave_out: str) -> None:
    """Likewise of a command on blocks of voxels, which chooses the coarsening by itself."""
    add_solid(parser, "coarsen", "discretisation", *WALL, *leave_out)


def require_outputs(arguments: argparse.Namespace, comm: MPI.Comm = MPI.COMM_SELF) -> None:
    """Check that the results can be written, and not in the place of what they are made from."""

    def check() -> None:
        given = vars(arguments)
        inputs = [given[name] for name in INPUTS if given.get(name) is not None]
        files = [path for each in inputs for path in (each if isinstance(each, list) else [each])]
        outputs.require_outputs(arguments, files)

    bcast_from_root(comm, check)


def parameters(arguments: argparse.Namespace) -> dict[str, Any]:
    """What a result was computed with, for its provenance."""
    return {key: value for key, value in vars(arguments).items() if key not in HIDDEN}


def add_outputs(parser: argparse.ArgumentParser) -> None:
    """Add the arguments that say where a measurement goes, see `tell_measured`."""
    parser.add_argument("--out", help="also write the result to this JSON file")
    parser.add_argument("--json", action="store_true", help="print JSON")


def tell_measured(
    arguments: argparse.Namespace,
    result: dict[str, Any],
    as_text: Callable[[dict[str, Any]], str],
    comm: MPI.Comm = MPI.COMM_SELF,
) -> None:
    """Add a measurement's `provenance` to it, write it to the file of `--out`, and print it."""
    result["provenance"] = measured(parameters(arguments))
    write_json(arguments, result, comm)
    print(json.dumps(result, indent=2) if arguments.json else as_text(result))


def measure_solid(
    arguments: argparse.Namespace,
    options: type[Options],
    measure: Callable[[Solid, Options, int], dict[str, Any]],
    as_lines: Callable[[dict[str, Any]], list[str]],
) -> None:
    """Run a command that measures a solid: build it, `measure`, write and print; collective.

    `measure` gets the solid, the command's own options and the seed.
    """
    with on_ranks() as comm:
        require_outputs(arguments, comm)
        described = collect(ProblemOptions, arguments)
        model = build_problem(described).model
        result = measure(model, collect(options, arguments), described.seed)
        tell_measured(arguments, result, lambda found: "\n".join(as_lines(found)), comm)


def write_json(
    arguments: argparse.Namespace, content: dict[str, Any], comm: MPI.Comm = MPI.COMM_SELF
) -> None:
    """Write a result to the file that `--out` names, if it names one."""

    def write() -> None:
        with atomic_path(arguments.out) as temporary:
            temporary.write_text(json.dumps(content))

    if arguments.out is not None:
        bcast_from_root(comm, write)
