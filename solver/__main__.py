"""Command line: `python -m solver COMMAND`; `--help` lists the commands."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from carillon import cli
from carillon.arguments import Parser, number_between, number_of_workers, whole_number
from carillon.errors import UserError
from carillon.fem import materials
from carillon.fem.element import DEFAULT_POISSON
from carillon.fem.geometry import FILLS, PIECES
from carillon.files import atomic_path, require_writable
from carillon.limits import EXTENTS, FARTHEST
from carillon.pictures import require_plottable
from carillon.progress import say
from carillon.runtime import limit_threads, warn_about_reference_blas
from dataset_gen.objectives import OBJECTIVES, require_objective
from solver import linear
from solver.analysis.modal_solver import ModalSolver, Modes
from solver.analysis.options import METHODS, SolverOptions
from solver.analysis.problem import Problem, ProblemOptions, build_problem
from solver.coarsening.coarsen import METHODS as COARSENINGS
from solver.correction.correct import ACCELERATIONS, EIGENVALUE_TOLERANCE, INTERACTIVE_TOLERANCE
from solver.distribution.collective import keep_on_root, on_root
from solver.hcms.condense import INTERFACES
from solver.linear import petsc_options
from solver.reference.truth import RESIDUAL_TOLERANCE

_PROBLEM_FIELDS = tuple(ProblemOptions.__dataclass_fields__)
_INPUTS = ("mesh", "material", "forest", "truth", "start")
_MODES = whole_number(1, 2**31 - 1)
_TOLERANCE = number_between(1e-15, 1.0)
_MOST_STEPS, _MOST_SOLIDS = 10_000, 100_000
_FARTHEST = EXTENTS[1] * FARTHEST


def main(arguments: list[str] | None = None) -> int:
    """Run the command; every rank returns the same status, or the whole job is aborted."""
    comm = MPI.COMM_WORLD
    found: list[argparse.Namespace] = []
    status = cli.run("solver", lambda: found.append(_parser().parse_args(arguments)), comm)
    for options in found:
        status = cli.run(f"solver {options.command}", partial(_run, options, comm), comm)
    return status


def _run(options: argparse.Namespace, comm: MPI.Comm) -> None:
    node = comm.Split_type(MPI.COMM_TYPE_SHARED)
    limit_threads(node.size)
    node.Free()
    if comm.rank == 0:
        warn_about_reference_blas()
    try:
        options.run(options, comm)
    except PETSc.Error as error:
        raise petsc_options.meaning(error, getattr(options, "petsc", None)) from error


def _require_outputs(options: argparse.Namespace) -> None:
    """Check that the results can be written, and not in the place of what they are made from."""
    given = vars(options)
    inputs = [given[name] for name in _INPUTS if given.get(name) is not None]
    files = [*inputs, *given.get("files", []), *given.get("candidates", [])]
    if given.get("plot") is not None:
        require_plottable(given["plot"])
    for name in ("out", "plot"):
        if given.get(name) is not None:
            require_writable(given[name], files)


def _modes(options: argparse.Namespace, comm: MPI.Comm) -> None:
    from solver.files.modes_file import write_modes
    from solver.files.start import start_from_file

    on_root(comm, lambda: _require_outputs(options))
    parameters = _problem_options(options)
    solver = SolverOptions(
        method=options.method,
        modes=options.modes,
        tolerance=options.tol,
        corrections=options.corrections,
        keep=options.keep,
        cutoff=options.cutoff,
        subdomains=options.subdomains,
        interface=options.interface,
        seed=options.seed,
        prove=options.prove,
        inner=options.inner,
        acceleration=options.acceleration,
    )
    problem = keep_on_root(comm, lambda: build_problem(parameters))
    model = None if problem is None else problem.model
    petsc_options.insert_options(options.petsc, options.method)
    prepared = ModalSolver(model, solver, comm, verbose=sys.stderr.isatty())
    start = None
    if options.start is not None:
        start = start_from_file(options.start, model, options.modes, prepared.share, comm)
    result = prepared.solve(start=start)
    result.seconds = {**prepared.seconds, **result.seconds}
    attributes = {} if problem is None else _modes_attributes(options, problem, result)

    def write(blocks: Iterator[NDArray[np.float64]]) -> None:
        assert model is not None
        write_modes(
            options.out,
            model,
            result.values,
            blocks,
            result.residuals,
            attributes,
            _command_parameters(options),
        )

    result.system.pour(result.vectors, write)
    if comm.rank == 0:
        _warn_about_options()
        _print_summary(attributes, result.values, options)


def _warn_about_options() -> None:
    unused = petsc_options.unused_options()
    if unused:
        say(f"warning: PETSc had no use for {', '.join(unused)}; see whether the names are right")


def _modes_attributes(
    options: argparse.Namespace, problem: Problem, result: Modes
) -> dict[str, Any]:
    attributes: dict[str, Any] = {
        "method": options.method,
        "coarsen": options.coarsen,
        "mesh": options.mesh,
        "resolution": options.resolution,
        "material": options.material,
        "seed": options.seed,
        "interface": options.interface,
        "fine_n_dofs": problem.fine.n_dofs,
        **problem.forest,
        **result.evidence,
        "timings": {**problem.seconds, **result.seconds},
    }
    if options.coarsen == "fit":
        attributes["objective"] = options.objective
    if options.tol is not None:
        attributes["tolerance"] = options.tol
    return attributes


def _print_summary(attributes: dict[str, Any], values: Any, options: argparse.Namespace) -> None:
    from solver.files.modes_file import frequencies

    hertz = frequencies(values)
    if options.json:
        print(json.dumps({**attributes, "frequencies_hz": hertz.tolist(), "out": options.out}))
        return
    total = sum(attributes["timings"].values())
    elastic = hertz[6:]
    span = f"{elastic[0]:.2f} to {elastic[-1]:.2f} Hz" if len(elastic) else "none elastic"
    added = attributes.get("modes_added", 0)
    late = f", {added} found after the first search" if added else ""
    print(
        f"{options.out}: {len(values)} modes of {attributes['n_dofs']:,} unknowns, {span}{late}; "
        f"{attributes['rigid_modes']} rigid, largest residual {attributes['residual_max']:.1e}, "
        f"orthogonal to {attributes['orthogonality']:.1e}, {total:.1f} s on {attributes['ranks']} "
        f"rank{'s' if attributes['ranks'] > 1 else ''}"
    )


def _compare(options: argparse.Namespace, comm: MPI.Comm) -> None:
    from carillon.provenance import record
    from solver.studies.comparison import compare_files

    comparison = on_root(comm, lambda: compare_files(options.candidate, options.truth).as_dict())
    if comm.rank:
        return
    if options.json:
        comparison["provenance"] = record(_command_parameters(options))
        print(json.dumps(comparison, indent=2))
        return
    error = comparison["eigenvalue_relative_error"]
    print(f"modes compared            {comparison['modes_compared']} (elastic)")
    print(
        f"eigenvalue error          median {error['median']:.2e}, 90 % below {error['p90']:.2e}, "
        f"max {error['max']:.2e}"
    )
    print(f"frequency error, rms      {comparison['frequency_rms_relative_error']:.2e}")
    print(
        f"frequency error, 7..60    rms {comparison['frequency_rms_relative_error_7_60']:.2e}, "
        f"max {comparison['frequency_max_relative_error_7_60']:.2e}"
    )
    print(f"largest subspace angle    {comparison['subspace_angle_max']:.2e} rad")
    print(f"largest residual          {comparison['residual_max']:.2e}")


def _audit(options: argparse.Namespace, comm: MPI.Comm) -> None:
    from carillon.provenance import record
    from solver.studies.audit import audit_files

    _require_one_rank(options, comm)
    _require_outputs(options)
    audits = {name: found.as_dict() for name, found in audit_files(options.files).items()}
    content = {"spectra": audits, "provenance": record(_command_parameters(options))}
    if options.out is not None:
        _write_json(options, content, comm)
    if options.json:
        print(json.dumps(content, indent=2))
        return
    for name, found in audits.items():
        print(
            f"{name}: {found['modes']} modes of {found['unknowns']:,} unknowns, "
            f"{found['rigid_modes']} rigid; largest residual {found['residual_max']:.1e}, "
            f"orthogonal to {found['orthogonality']:.1e}; {found['expected']} below "
            f"{found['counted_below']:.6g} rad^2/s^2, counted {found['counted']}"
        )


def _respond(options: argparse.Namespace, comm: MPI.Comm) -> None:
    from solver.response.response import Damping
    from solver.response.response_file import TRUTH, StrikeOptions, respond, write_response

    _require_one_rank(options, comm)
    _require_outputs(options)
    strike = StrikeOptions(
        options.strike,
        options.observed,
        Damping(options.mass_damping, options.stiffness_damping),
        options.contact,
        options.periods,
    )
    candidates = {Path(path).stem: path for path in options.candidates}
    if len(candidates) < len(options.candidates) or TRUTH in candidates:
        raise UserError(
            f"files called {', '.join(sorted(Path(path).stem for path in options.candidates))}: "
            f"expected names that differ from each other and from {TRUTH!r}; rename one"
        )
    found = respond(options.truth, candidates, strike)
    write_response(options.out, found, _command_parameters(options))
    for name, response in found.responses.items():
        print(
            f"{name}: differs from {options.truth} by {response.difference:.2e} in displacement, "
            f"{response.distance_decibels:.2g} dB in sound"
        )


def _require_one_rank(options: argparse.Namespace, comm: MPI.Comm) -> None:
    if comm.size > 1:
        raise UserError(f"{options.command} runs on one rank, {comm.size} were started")


def _convergence(options: argparse.Namespace, comm: MPI.Comm) -> None:
    from carillon.measurement import measured
    from solver.studies.convergence import correction_history

    on_root(comm, lambda: _require_outputs(options))
    problem = keep_on_root(comm, lambda: build_problem(_problem_options(options)))
    model = None if problem is None else problem.model
    history = correction_history(
        model, options.modes, options.steps, options.seed, options.truth, comm
    )
    history["provenance"] = measured(_command_parameters(options), comm.size)
    _write_json(options, history, comm)


def _benchmark(options: argparse.Namespace, comm: MPI.Comm) -> None:
    from carillon.measurement import measured
    from solver.studies.benchmark import BenchmarkOptions, benchmark_row, row_lines

    on_root(comm, lambda: _require_outputs(options))
    benchmark = BenchmarkOptions(
        options.modes,
        options.runs,
        options.slow_runs,
        not options.skip_arpack,
        options.arpack_regular,
        options.tune,
    )
    row = benchmark_row(_problem_options(options), benchmark, comm)
    row["provenance"] = measured(_command_parameters(options), comm.size)
    if options.out is not None:
        _write_json(options, row, comm)
    if comm.rank == 0:
        print(json.dumps(row, indent=2) if options.json else "\n".join(row_lines(row)))


def _scaling(options: argparse.Namespace, comm: MPI.Comm) -> None:
    from carillon.measurement import measured
    from solver.studies.scaling import ScalingOptions, measure, scaling_study, study_lines

    on_root(comm, lambda: _require_outputs(options))
    if options.here or comm.size > 1:
        problem = keep_on_root(comm, lambda: build_problem(_problem_options(options)))
        model = None if problem is None else problem.model
        solver = SolverOptions(
            modes=options.modes, tolerance=options.tol, seed=options.seed, inner=options.inner
        )
        found = measure(model, solver, comm)
        lines = [f"{comm.size} ranks: {found['seconds']:.2f} s"]
        found["provenance"] = measured(_command_parameters(options), comm.size)
    else:
        study = ScalingOptions(
            options.modes,
            options.tol,
            tuple(options.ranks),
            options.weak,
            options.inner,
            options.latency,
            options.bandwidth,
        )
        found = scaling_study(_problem_options(options), study, _repeated(options))
        lines = study_lines(found)
        found["provenance"] = measured(_command_parameters(options), options.ranks, threads=1)
    if options.out is not None:
        _write_json(options, found, comm)
    if comm.rank:
        return
    if options.plot is not None and "strong" in found:
        from solver.studies.scaling.plot import save_plot

        save_plot(found, options.plot)
    print(json.dumps(found, indent=2) if options.json else "\n".join(lines))


def _repeated(options: argparse.Namespace) -> list[str]:
    """Arguments with which the same solid is solved again, but for mesh and resolution."""
    names = [name for name in _PROBLEM_FIELDS if name not in ("mesh", "resolution")]
    arguments: list[str] = []
    for name in (*names, "modes", "tol", "inner"):
        value = getattr(options, name)
        if value is True:
            arguments.append(f"--{name}")
        elif value is not None and value is not False:
            arguments += [f"--{name}", str(value)]
    return arguments


def _objectives(options: argparse.Namespace, comm: MPI.Comm) -> None:
    from carillon.provenance import record
    from solver.studies.objectives import rate_objectives

    on_root(comm, lambda: _require_outputs(options))
    found = rate_objectives(_problem_options(options), options.modes, options.objectives, comm)
    found["provenance"] = record(_command_parameters(options))
    if options.out is not None:
        _write_json(options, found, comm)
    if comm.rank:
        return
    if options.json:
        print(json.dumps(found, indent=2))
    else:
        _print_objectives(found)


def _calibrate(options: argparse.Namespace, comm: MPI.Comm) -> None:
    from carillon.provenance import record
    from solver.studies.calibration.constants import Constants
    from solver.studies.calibration.exact import make_cases
    from solver.studies.calibration.gauss_newton import calibrate_in_turn, rms_by_material, say_step

    if comm.size > 1:
        raise UserError("calibrate runs on one rank; share its work with --workers instead")
    _require_outputs(options)
    paths = make_cases(
        Path(options.cases), options.seed, options.solids, objects=not options.random_only
    )
    start = Constants.neutral()
    found = calibrate_in_turn(
        paths, start, DEFAULT_POISSON, options.workers, options.steps, report=say_step
    )
    source = record(
        {name: getattr(options, name) for name in ("solids", "random_only", "seed", "steps")}
    )
    del source["command"]  # It names folders of this machine, and the file goes into the package.
    content = {
        **found.constants.as_json(),
        "provenance": {
            **source,
            "settled": found.settled,
            "rms_before": rms_by_material(paths, start, options.workers),
            "rms_after": rms_by_material(paths, found.constants, options.workers),
        },
    }
    with atomic_path(options.out) as temporary:
        temporary.write_text(json.dumps(content, indent=1) + "\n")


def _print_objectives(found: dict[str, Any]) -> None:
    print(
        f"{found['n_dofs']:,} unknowns coarsened to {found['coarse_n_dofs']:,}; frequency errors "
        "against SLEPc on the fine mesh"
    )
    last = {part: max(row[part]["last"] for row in found["rows"]) for part in ("audible", "all")}
    parts = ["audible", "all"] if last["all"] > last["audible"] else ["all"]
    spans = [f"modes 7 to {last[part]}" for part in parts]
    heads = "     rms     mean    worst  mode" * len(parts)
    print(f"{'':<14s}" + "".join(f"{span:>32s}" for span in spans))
    print(f"{'':<14s}{heads}      fit    modes")
    for row in found["rows"]:
        errors = "".join(_errors(row[part]) for part in parts)
        seconds = "".join(f"{row[f'{step}_seconds']:7.2f} s" for step in ("fit", "solve"))
        print(f"{row['coarsening']:<14s}{errors}{seconds}")


def _errors(errors: dict[str, Any]) -> str:
    percent = f"{errors['rms']:8.1%} {errors['mean']:+8.1%} {errors['worst']:+8.1%}"
    return f"{percent} {errors['worst_mode']:5d}"


def _write_json(options: argparse.Namespace, content: dict[str, Any], comm: MPI.Comm) -> None:
    def write() -> None:
        with atomic_path(options.out) as temporary:
            temporary.write_text(json.dumps(content))

    on_root(comm, write)


def _problem_options(options: argparse.Namespace) -> ProblemOptions:
    given = vars(options)
    return ProblemOptions(**{name: given[name] for name in _PROBLEM_FIELDS if name in given})


def _command_parameters(options: argparse.Namespace) -> dict[str, Any]:
    hidden = ("run", "out", "json")
    return {key: value for key, value in vars(options).items() if key not in hidden}


def _tolerance(text: str) -> float:
    """Argument type: a relative tolerance that double precision can reach, or 0 for none."""
    value = number_between(0.0, 1.0)(text)
    return value if value == 0.0 else _TOLERANCE(text)


def _objective_names(text: str) -> list[str]:
    """Argument type: names of objectives, separated by commas."""
    names = list(dict.fromkeys(text.split(",")))
    try:
        for name in names:
            require_objective(name)
    except UserError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    return names


def _rank_counts(text: str) -> list[int]:
    """Argument type: numbers of ranks, separated by commas, each once and ascending."""
    from solver.studies.scaling.launch import MOST_RANKS

    return sorted({whole_number(1, MOST_RANKS)(part) for part in text.split(",")})


def _parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="solver",
        description="Vibration modes of solids with spatially varying material.",
    )
    commands = parser.add_subparsers(dest="command", required=True)

    modes = commands.add_parser("modes", help="compute modes and write modes.h5")
    _add_problem(modes)
    modes.add_argument("--method", choices=METHODS, default="hcms", help="default: %(default)s")
    modes.add_argument(
        "--modes", type=_MODES, default=256, help="number, rigid included (default 256)"
    )
    modes.add_argument("--out", required=True, help="modes file to write (HDF5)")
    modes.add_argument(
        "--tol",
        type=_tolerance,
        help="hcms: relative eigenvalue error to correct to "
        f"(default {EIGENVALUE_TOLERANCE:g}; 0 makes exactly --corrections steps); "
        f"slepc, arpack: residual tolerance (default {RESIDUAL_TOLERANCE:g})",
    )
    modes.add_argument(
        "--corrections",
        type=whole_number(0, _MOST_STEPS),
        default=SolverOptions.corrections,
        help="largest number of correction steps; 0 is plain HCMS (default %(default)s)",
    )
    modes.add_argument(
        "--inner",
        choices=linear.METHODS,
        default=SolverOptions.inner,
        help="inner solver of the corrections (default: the fastest direct one)",
    )
    modes.add_argument(
        "--acceleration",
        choices=ACCELERATIONS,
        default=SolverOptions.acceleration,
        help="of the corrections; relaxation is the paper's (default %(default)s)",
    )
    modes.add_argument(
        "--start", metavar="MODES", help="modes file of a similar material to start from"
    )
    modes.add_argument(
        "--petsc",
        metavar="OPTIONS",
        help='options for PETSc and SLEPc with the prefix carillon_, as in "-carillon_eps_ncv 400"',
    )
    modes.add_argument(
        "--prove",
        action=argparse.BooleanOptionalAction,
        help="count the eigenvalues by inertia, and find those that are missing (default: for "
        "slepc and arpack)",
    )
    modes.add_argument("--keep", type=_MODES, help="modes kept at the root of the merge tree")
    modes.add_argument(
        "--cutoff",
        type=number_between(1e-9, 1e15, "Hz"),
        metavar="HZ",
        help="frequency up to which HCMS keeps modes below the root (default: a number of them)",
    )
    modes.add_argument("--subdomains", type=_MODES, help="number of subdomains")
    modes.add_argument(
        "--interface",
        choices=INTERFACES,
        default=SolverOptions.interface,
        help="treatment of interfaces by HCMS (default %(default)s)",
    )
    modes.add_argument("--json", action="store_true", help="print a summary as JSON")
    modes.set_defaults(run=_modes)

    compare = commands.add_parser("compare", help="errors of one modes file against another")
    compare.add_argument("candidate", help="modes file to judge")
    compare.add_argument("truth", help="modes file taken for the truth")
    compare.add_argument("--json", action="store_true", help="print JSON")
    compare.set_defaults(run=_compare)

    audit = commands.add_parser(
        "audit", help="residuals, orthogonality and inertia count anew, from modes files alone"
    )
    audit.add_argument("files", nargs="+", metavar="FILE", help="modes files")
    audit.add_argument("--out", help="also write the result to this JSON file")
    audit.add_argument("--json", action="store_true", help="print JSON")
    audit.set_defaults(run=_audit)

    _add_respond(commands.add_parser("respond", help="motion and sound of a strike (Fig. 12, 13)"))

    convergence = commands.add_parser(
        "convergence", help="eigenvalues after each correction from several starts (Fig. 10)"
    )
    _add_problem(convergence)
    convergence.add_argument(
        "--modes", type=_MODES, default=256, help="rigid included (default 256)"
    )
    convergence.add_argument(
        "--steps", type=whole_number(0, _MOST_STEPS), default=3, help="corrections (default 3)"
    )
    convergence.add_argument(
        "--truth", help="modes file with the exact eigenvalues (default: SLEPc finds them)"
    )
    convergence.add_argument("--out", required=True, help="JSON file to write")
    convergence.set_defaults(run=_convergence)

    benchmark = commands.add_parser("benchmark", help="time all methods on one solid (Fig. 11)")
    _add_solid(benchmark)
    benchmark.add_argument("--forest", help="forests to coarsen by (HDF5; default: packaged)")
    benchmark.add_argument("--modes", type=_MODES, default=256, help="rigid included (default 256)")
    benchmark.add_argument(
        "--runs",
        type=whole_number(1, _MOST_STEPS),
        default=5,
        help="rounds of all methods (default 5)",
    )
    benchmark.add_argument(
        "--slow-runs",
        type=whole_number(1, _MOST_STEPS),
        help="rounds that ARPACK runs in (default: all)",
    )
    benchmark.add_argument("--skip-arpack", action="store_true", help="leave the slowest one out")
    benchmark.add_argument(
        "--arpack-regular",
        action="store_true",
        help="also ARPACK without a factorisation, on a lumped mass",
    )
    benchmark.add_argument(
        "--tune", action="store_true", help="SLEPc in the fastest of several configurations"
    )
    benchmark.add_argument("--out", help="also write the row to this JSON file")
    benchmark.add_argument("--json", action="store_true", help="print JSON")
    benchmark.set_defaults(run=_benchmark)

    scaling = commands.add_parser(
        "scaling", help="wall time over the number of ranks, measured and modelled"
    )
    _add_problem(scaling)
    scaling.add_argument("--modes", type=_MODES, default=256, help="rigid included (default 256)")
    scaling.add_argument(
        "--ranks",
        type=_rank_counts,
        default=[1, 2],
        help="numbers of ranks to run on, separated by commas (default 1,2)",
    )
    scaling.add_argument(
        "--weak", action="store_true", help="also a solid that grows with the ranks"
    )
    scaling.add_argument(
        "--tol",
        type=_TOLERANCE,
        default=INTERACTIVE_TOLERANCE,
        help="relative eigenvalue error to correct to (default %(default)g)",
    )
    scaling.add_argument(
        "--inner",
        choices=linear.METHODS,
        default="mumps",
        help="inner solver, the same on any number of ranks (default %(default)s)",
    )
    scaling.add_argument(
        "--latency",
        type=number_between(1e-12, 1e3, "s"),
        help="of the modelled network [s] (default: measured)",
    )
    scaling.add_argument(
        "--bandwidth",
        type=number_between(1.0, 1e18, "B/s"),
        help="of the modelled network [B/s] (the same)",
    )
    scaling.add_argument("--here", action="store_true", help=argparse.SUPPRESS)
    scaling.add_argument("--out", help="also write the result to this JSON file")
    scaling.add_argument("--plot", help="figure to draw (PNG, SVG or PDF)")
    scaling.add_argument("--json", action="store_true", help="print JSON")
    scaling.set_defaults(run=_scaling)

    objectives = commands.add_parser(
        "objectives", help="spectra of one solid coarsened by every fit objective, and by forests"
    )
    _add_solid(objectives)
    objectives.add_argument("--forest", help="forests to compare with (HDF5; default: packaged)")
    objectives.add_argument(
        "--modes", type=_MODES, default=256, help="rigid included (default 256)"
    )
    objectives.add_argument(
        "--objectives",
        type=_objective_names,
        default=list(OBJECTIVES),
        help="separated by commas (default: all)",
    )
    objectives.add_argument("--out", help="also write the result to this JSON file")
    objectives.add_argument("--json", action="store_true", help="print JSON")
    objectives.set_defaults(run=_objectives)

    calibrate = commands.add_parser(
        "calibrate", help="constants of the objective `calibrated` from spectra of random solids"
    )
    calibrate.add_argument(
        "--solids",
        type=whole_number(1, _MOST_SOLIDS),
        default=150,
        help="random solids (default 150)",
    )
    calibrate.add_argument(
        "--random-only", action="store_true", help="leave the built-in objects out"
    )
    calibrate.add_argument("--seed", type=whole_number(0), default=0, help="of the solids")
    calibrate.add_argument(
        "--steps",
        type=whole_number(1, _MOST_STEPS),
        default=10,
        help="Gauss-Newton steps at most (default 10)",
    )
    calibrate.add_argument("--workers", type=number_of_workers, default=1, help="processes")
    calibrate.add_argument(
        "--cases", required=True, help="folder that keeps the solids' exact spectra"
    )
    calibrate.add_argument("--out", required=True, help="JSON file to write")
    calibrate.set_defaults(run=_calibrate)
    return parser


def _add_respond(parser: argparse.ArgumentParser) -> None:
    from solver.response.response import Damping
    from solver.response.response_file import StrikeOptions

    parser.add_argument("truth", help="modes file taken for the truth")
    parser.add_argument(
        "candidates", nargs="*", metavar="FILE", help="modes files to set beside it"
    )
    parser.add_argument("--out", required=True, help="file to write (HDF5)")
    for name, what in (("strike", "that is struck"), ("observed", "whose motion is watched")):
        parser.add_argument(
            f"--{name}",
            type=number_between(-_FARTHEST, _FARTHEST, "m"),
            nargs=3,
            metavar=("X", "Y", "Z"),
            help=f"point of the surface {what} [m] (default: chosen by the truth)",
        )
    damping = Damping()
    parser.add_argument(
        "--mass-damping",
        type=number_between(0.0, 1e12, "1/s"),
        default=damping.mass_per_second,
        help="coefficient of the mass in Rayleigh damping [1/s] (default %(default)g)",
    )
    parser.add_argument(
        "--stiffness-damping",
        type=number_between(0.0, 1e6, "s"),
        default=damping.stiffness_seconds,
        help="coefficient of the stiffness [s] (default %(default)g)",
    )
    parser.add_argument(
        "--contact",
        type=number_between(1e-9, 10.0, "s"),
        default=StrikeOptions.contact_seconds,
        help="duration of the force in the sound [s] (default %(default)g)",
    )
    parser.add_argument(
        "--periods",
        type=number_between(1e-6, 1e6),
        default=StrikeOptions.periods,
        help="time watched, in periods of the first elastic mode (default %(default)g)",
    )
    parser.set_defaults(run=_respond)


def _add_problem(parser: argparse.ArgumentParser) -> None:
    _add_solid(parser)
    defaults = ProblemOptions
    parser.add_argument(
        "--coarsen", choices=COARSENINGS, default=defaults.coarsen, help="default: none"
    )
    parser.add_argument("--forest", help="forests for --coarsen ddfem (HDF5; default: packaged)")
    parser.add_argument(
        "--objective",
        choices=OBJECTIVES,
        default=defaults.objective,
        help="for --coarsen fit (default %(default)s)",
    )


def _add_solid(parser: argparse.ArgumentParser) -> None:
    defaults = ProblemOptions
    parser.add_argument("mesh", metavar="MESH", help="surface mesh file, or builtin:NAME")
    parser.add_argument(
        "--resolution", type=whole_number(2), required=True, help="voxels along the longest side"
    )
    parser.add_argument(
        "--material",
        default=defaults.material,
        help=f"{', '.join(materials.NAMES)}, or a file with one Young's modulus [Pa] per voxel "
        "(default %(default)s)",
    )
    parser.add_argument(
        "--unit", type=float, default=defaults.unit, help="metres per mesh unit (default 1)"
    )
    parser.add_argument(
        "--fill", choices=sorted(FILLS), default=defaults.fill, help="voxel filling"
    )
    parser.add_argument(
        "--pieces", choices=PIECES, default=defaults.pieces, help="if the voxels fall apart"
    )
    parser.add_argument(
        "--poisson", type=float, default=defaults.poisson, help="Poisson's ratio (default 0.25)"
    )
    parser.add_argument(
        "--density", type=float, default=defaults.density, help="kg/m^3 (default 1000)"
    )
    parser.add_argument("--lumped", action="store_true", help="lump the mass")
    parser.add_argument(
        "--seed",
        type=whole_number(0),
        default=defaults.seed,
        help="of random materials, the partition, and the vectors that slepc and arpack start from",
    )


if __name__ == "__main__":
    sys.exit(main())
