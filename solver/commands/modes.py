"""Compute the lowest modes of a solid and write them to a file.

It may be started on several ranks, with the same result:
mpiexec -n RANKS python -m mpi4py -m carillon modes ...
"""

import argparse
import sys
import time
from collections.abc import Iterator
from typing import Any

from carillon.arrays import Array
from carillon.command_line.progress import say
from carillon.errors import UserError, on_all_ranks
from carillon.fem.model import Solid
from carillon.parameters.command_line import add_options, collect, reader
from carillon.parameters.quantities import Resolution
from carillon.processes.mpi import MPI
from solver.accuracy.solving import (
    FIRST_RESOLUTION,
    AccuracyRequest,
    DistanceOptions,
    Solved,
    solve_solid,
)
from solver.analysis.coarse_start import coarse_start
from solver.analysis.faster_method import FEWEST_UNKNOWNS
from solver.analysis.modal_solver import ModalSolver
from solver.analysis.modes import Initial
from solver.analysis.options import AUTO, SolverOptions
from solver.analysis.phases import RankClock
from solver.analysis.problem import ProblemOptions
from solver.coarsening.choice import make_coarsening
from solver.coarsening.coarsening import Coarsening
from solver.coarsening.forest import forest_or_reason
from solver.commands.modes_summary import (
    REFINED,
    attributes_of,
    phase_table,
    print_json,
    print_summary,
)
from solver.commands.running import add_solid, on_ranks, parameters, require_outputs
from solver.distribution.collective import compute_on_root
from solver.files.initial_modes import modes_from_file
from solver.files.modes_file import write_modes
from solver.linear import petsc_options
from solver.refinement.errors import RefinementOptions, RefinementStep
from solver.refinement.model_solver import Beginning, SolveByOptions

EXAMPLES = """examples:
  modes builtin:bell --resolution 32 --out bell.h5
  modes bunny.obj --resolution 48 --material two-region --coarsen ddfem --modes 60 --out bunny.h5
  modes bunny.obj --resolution 48 --method slepc --modes 60 --out truth.h5
"""
WRITING = "writing"
"""Phase that writes the modes file."""


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
    parser.add_argument(
        "--phases",
        action="store_true",
        help="print what the busiest rank took in each phase; --json tells it of all ranks",
    )


def run(arguments: argparse.Namespace) -> None:
    """Build the solid, solve, verify, write."""
    with on_ranks(arguments.petsc) as comm:
        clock = RankClock.of_process(comm)
        require_outputs(arguments, comm)
        solid, solver, accuracy = _options(arguments)
        petsc_options.insert_options(arguments.petsc, solver.method)
        begin = _beginning(arguments, solid, comm)
        solve = SolveByOptions(solver, comm, sys.stderr.isatty(), begin, clock)
        start = time.perf_counter()
        solved = solve_solid(solid, solve, solver, accuracy, comm, _report, clock)
        attributes = attributes_of(solved, solver, accuracy, time.perf_counter() - start)
        with clock(WRITING):
            _write(solved, attributes, arguments)
        by_rank = clock.by_rank()
        if comm.rank == 0:
            _warn_about_options()
            if arguments.json:
                print_json(attributes, solved, arguments.out, by_rank)
                return
            print_summary(attributes, solved, arguments.out)
            if arguments.phases:
                print(phase_table(by_rank))


@on_all_ranks()
def _options(
    arguments: argparse.Namespace,
) -> tuple[ProblemOptions, SolverOptions, AccuracyRequest]:
    """The solid, what is computed and how, and how accurate it shall be."""
    distance = collect(DistanceOptions, arguments)
    resolution = _resolution(arguments.resolution, distance.accuracy)
    given = argparse.Namespace(**{**vars(arguments), "resolution": resolution})
    solid, solver = collect(ProblemOptions, given), collect(SolverOptions, given)
    is_told = distance.estimate is not False and (solver.is_general or solver.is_corrected)
    refine_to = collect(RefinementOptions, given).tolerance(
        solid.coarsen, solid.discretisation, is_told, distance.accuracy
    )
    initial = arguments.initial_modes
    if arguments.refine:
        _require_no_other_start(solid, initial)
    estimated = distance.is_estimated(solid, solver)
    if estimated and solid.discretisation == "finite-cell":
        is_asked = distance.accuracy is not None or distance.estimate or refine_to is not None
        if not is_asked and not solver.is_general and not solver.is_corrected:
            estimated = False
        else:
            solver = solver.for_residuals()
    return solid, solver, AccuracyRequest(distance.accuracy, refine_to, estimated, initial)


def _resolution(given: int | None, accuracy: float | None) -> int:
    if given is not None:
        return given
    if accuracy is None:
        raise UserError("expected --resolution, or --accuracy to choose one")
    return FIRST_RESOLUTION


def _require_no_other_start(solid: ProblemOptions, initial_modes: str | None) -> None:
    if solid.coarsen != "none" or solid.discretisation != "voxel":
        raise UserError("--refine starts from the coarsened solid: expected voxels, --coarsen none")
    if initial_modes is not None:
        raise UserError("--refine makes the modes to start from: leave out --initial-modes")


class _FileStart:
    """Modes of a file, which the first analysis starts from; later ones are of other meshes."""

    def __init__(self, path: str) -> None:
        self._path: str | None = path

    def suits(self, _solver: ModalSolver) -> bool:
        return self._path is not None

    def __call__(self, solver: ModalSolver, model: Solid | None) -> Initial:
        path, self._path = self._path, None
        assert path is not None
        return modes_from_file(path, model, solver.options.modes, solver.local_mesh, solver.comm)


class _CoarseStart:
    """Modes of the coarsened solid, to start from.

    Where they are not `asked` for, conjugate gradients in a large solid start from them.
    """

    def __init__(self, solid: ProblemOptions, comm: MPI.Comm, asked: bool) -> None:
        self._solid, self._comm, self._asked = solid, comm, asked

    def suits(self, solver: ModalSolver) -> bool:
        large = solver.local_mesh.n_dofs >= FEWEST_UNKNOWNS
        return self._asked or (large and solver.options.method == "lobpcg")

    def __call__(self, solver: ModalSolver, model: Solid | None) -> Initial:
        return coarse_start(
            solver, model, compute_on_root(self._comm, lambda: self._coarsening(model))
        )

    def _coarsening(self, model: Solid | None) -> Coarsening:
        assert model is not None
        forest, _ = forest_or_reason(self._solid.forest, *model.regions.ratios)
        coarsening = forest or make_coarsening("galerkin")
        assert coarsening is not None
        return coarsening


def _beginning(
    arguments: argparse.Namespace, solid: ProblemOptions, comm: MPI.Comm
) -> Beginning | None:
    if arguments.initial_modes is not None:
        return _FileStart(arguments.initial_modes)
    voxels = solid.coarsen == "none" and solid.discretisation == "voxel"
    if arguments.refine or (voxels and arguments.method == AUTO):
        return _CoarseStart(solid, comm, arguments.refine)
    return None


def _write(solved: Solved, attributes: dict[str, Any], arguments: argparse.Namespace) -> None:
    solid, model, result = solved.solid, solved.model, solved.modes
    chosen = {"resolution": solid.resolution, "coarsen": solid.coarsen}
    recorded = {**parameters(arguments), **chosen}

    def write(blocks: Iterator[Array]) -> None:
        assert model is not None
        write_modes(
            arguments.out, model, result.values, blocks, result.residuals, attributes, recorded
        )

    result.system.stream_to_root(result.vectors, write)


def _report(step: RefinementStep) -> None:
    errors = step.errors
    say(
        f"{step.unknowns:,} unknowns, {step.refined:,} {REFINED[step.counted]}: frequencies are "
        f"expected to be {errors.rms:.1%} off, mode {errors.worst_mode} {errors.worst:+.1%}",
        visible=sys.stderr.isatty(),
    )


def _warn_about_options() -> None:
    unused = petsc_options.unused_options()
    if unused:
        say(f"warning: PETSc had no use for {', '.join(unused)}; see whether the names are right")
