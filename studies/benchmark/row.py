"""One row of the time table: all methods in alternating runs, with what they are worth."""

import logging
from collections.abc import Mapping
from dataclasses import asdict
from functools import partial
from typing import Any, cast

import numpy as np

from carillon.command_line.progress import track
from carillon.errors import ConvergenceError
from carillon.fem.geometry import surface_name
from carillon.processes.blas import blas_name, loaded_blas
from carillon.processes.mpi import MPI
from solver.analysis.problem import ProblemOptions
from solver.distribution.collective import bcast_from_root, compute_on_root
from solver.verification.matching import AUDIBLE_LAST
from studies.benchmark.further_rivals import RIVALS
from studies.benchmark.methods import MethodRun, Methods
from studies.benchmark.options import BenchmarkOptions
from studies.benchmark.rivals import SlepcConfiguration, configurations
from studies.benchmark.scores import spectrum_error, speedups, tone_error
from studies.benchmark.solid import BenchmarkSolid, make_solid
from studies.benchmark.table import METHODS

logger = logging.getLogger(__name__)

Runs = dict[str, list[MethodRun]]

WARM_UP_MODES = 20
"""Modes of the runs that compile the kernels and load what they need."""

MEANING = {
    "seconds": "median wall time from moduli to modes: coarsening, assembly and solution; what "
    "needs the mesh alone is in precompute, checks of the result are in neither",
    "precompute": "voxels or cells, material, blocks, and for each mesh partition, sparsity and "
    "elimination plan, made once for any material",
    "speedup": "seconds of the inner name over seconds of the outer name",
    "speedup_with_precompute": "the same, with the partition, sparsity and elimination plan of the "
    "outer name added to its seconds, and nothing to those of the inner name",
    **{
        name: method.meaning
        for name, method in METHODS.items()
        if method.meaning and name not in RIVALS
    },
    "eigenvalue_error": "relative to SLEPc's eigenvalues of the same operator, fine or coarse",
    "missed": "modes that a general eigensolver's search missed in some run, found by further "
    "searches that it is not charged for",
    "frequency_error": "of the coarse model, by mode number, relative to SLEPc on the fine mesh",
}
"""Meaning of the figures of a row, kept with the row."""


def benchmark_row(
    options: ProblemOptions,
    benchmark: BenchmarkOptions = BenchmarkOptions(),
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> dict[str, Any]:
    """Time every method on one solid and compare what they find.

    Without forests, neither named nor default ones, the methods that need them are left out with a
    sentence, and their figures are None.

    Returns plain values: `seconds`, `spread`, `eigenvalue_error`, `frequency_error`, `speedup` by
    method, sizes, the machine; `meaning` explains them.

    Raises
    ------
    UserError
        For anything wrong with the solid, the forests or the number of modes.
    ConvergenceError
        If SLEPc fails; another method that does is told in `failed` and has no figures.
    """
    solid = compute_on_root(comm, partial(make_solid, options, benchmark.modes))
    reason, voxels = comm.bcast(None if solid is None else (solid.reason, solid.blocks is not None))
    if comm.rank == 0 and reason:
        logger.warning(reason)
    left_out = benchmark.left_out
    absent = {"forests"} if voxels else {"forests", "voxels"}
    if reason:
        left_out += tuple(name for name, method in METHODS.items() if method.needs in absent)
    default = SlepcConfiguration.default(comm.size)
    few = min(WARM_UP_MODES, benchmark.modes)
    _warm_up(Methods(solid, few, default, options.seed, comm, brief=True), left_out)
    methods = Methods(
        solid,
        benchmark.modes,
        default,
        options.seed,
        comm,
        rival_seconds=benchmark.rival_seconds,
    )
    tried = _tune(methods) if benchmark.tune else {}
    if tried:
        methods.configuration = min(tried, key=tried.__getitem__)
    runs, failed = _alternate(methods, benchmark, left_out)
    spectra = _references(methods, runs, averages=voxels, forests=not reason)
    row = {
        **bcast_from_root(comm, lambda: _describe(options, cast(BenchmarkSolid, solid))),
        "modes": benchmark.modes,
        **_times(runs, comm.bcast(None if solid is None else solid.seconds), benchmark),
        **_errors(runs, spectra),
        "slepc_configuration": asdict(methods.configuration),
        "slepc_configurations_tried": [
            {**asdict(configuration), "seconds": seconds}
            for configuration, seconds in tried.items()
        ],
        "runs": {name: len(results) for name, results in runs.items()},
        "failed": failed,
        "missed": {
            name: most
            for name, results in runs.items()
            if (most := max(run.added for run in results))
        },
        "ranks": comm.size,
        "threads": max((int(library["num_threads"]) for library in loaded_blas()), default=1),
        "blas": blas_name(),
        "problem": {
            name: method.problem
            for name, method in METHODS.items()
            if method.problem and name not in left_out
        },
        "meaning": MEANING | {name: RIVALS[name].meaning for name in benchmark.further},
    }
    methods.release()
    return row


def row_lines(row: Mapping[str, Any]) -> list[str]:
    """A row as people read it."""
    coarse = "" if row["dof_coarse"] is None else f", coarsened {row['dof_coarse']:,}"
    lines = [f"{row['dof_fine']:,} unknowns{coarse}, {row['modes']} modes"]
    for name, seconds in row["seconds"].items():
        if seconds is None:
            continue
        between = row["spread"].get(name)
        shown = f" ({between['min']:.2f} to {between['max']:.2f})" if between else ""
        error = row["eigenvalue_error"].get(name)
        worst = f"  worst eigenvalue error {error['max']:.1e}" if error else ""
        lines.append(f"{name:<20s}{seconds:8.2f} s{shown}{worst}")
    lines += [
        f"{name:<20s}missed {count} modes, found off the clock"
        for name, count in row["missed"].items()
    ]
    lines += [f"{name:<20s}failed: {reason}" for name, reason in row["failed"].items()]
    last = min(AUDIBLE_LAST, row["modes"])
    for name, error in row["frequency_error"].items():
        lines.append(
            f"{name:<20s}frequencies of modes 7 to {last} off by {error['rms_7_60']:.2%} rms"
        )
    return lines


def _warm_up(brief: Methods, left_out: tuple[str, ...]) -> None:
    """Compile and load what every method needs; rivals may fail, and compile nothing."""
    for name, method in METHODS.items():
        if name not in left_out and name not in RIVALS:
            method.run(brief)
    brief.release()


def _tune(methods: Methods) -> dict[SlepcConfiguration, float]:
    """Seconds of SLEPc on the fine mesh in each configuration, tried once."""
    visible = methods.comm.rank == 0
    tried = {}
    for configuration in track(configurations(methods.comm.size), "tuning", visible=visible):
        methods.configuration = configuration
        tried[configuration] = methods.comm.bcast(methods.general("slepc").seconds)
        if visible:
            logger.info(f"SLEPc with {configuration}: {tried[configuration]:.2f} s")
    return tried


def _alternate(
    methods: Methods, benchmark: BenchmarkOptions, left_out: tuple[str, ...]
) -> tuple[Runs, dict[str, str]]:
    """Runs of every method, one a round, and why a method has none."""
    chosen = [name for name in METHODS if name not in left_out]
    runs: Runs = {name: [] for name in chosen}
    plan = [
        name
        for number in range(benchmark.runs)
        for name in chosen
        if number < benchmark.rounds(name)
    ]
    failed: dict[str, str] = {}
    for name in track(plan, "runs", visible=methods.comm.rank == 0):
        if name in failed:
            continue
        try:
            runs[name].append(METHODS[name].run(methods))
        except ConvergenceError as error:
            # The others are worth knowing; without SLEPc's there is nothing to compare with.
            if name == "slepc" or not error.collective:
                raise
            failed[name] = str(error)
            runs.pop(name)
            if methods.comm.rank == 0:
                logger.warning(f"{name}: {error}")
    return runs, failed


def _references(
    methods: Methods, runs: Runs, averages: bool, forests: bool
) -> dict[str, MethodRun]:
    """Spectra by SLEPc that the others are compared with."""
    spectra = {"fine": runs["slepc"][0]}
    if averages:
        spectra["average"] = methods.general("slepc", "average")
    if forests:
        coarse = runs["ddfem"][0] if "ddfem" in runs else methods.general("slepc", "ddfem")
        spectra["coarse"] = coarse
        spectra["coarse_changed"] = methods.general("slepc", "ddfem", changed=True)
    return spectra


def _describe(options: ProblemOptions, solid: BenchmarkSolid) -> dict[str, Any]:
    return {
        "model": surface_name(options.mesh),
        "mesh": options.mesh,
        "resolution": options.resolution,
        "material": options.material,
        "discretisation": options.discretisation,
        "lumped": options.lumped,
        "dof_fine": solid.fine.n_dofs,
        "dof_coarse": None if solid.blocks is None else 3 * solid.blocks.coarse.n_nodes,
        "forest": None if solid.forest is None else solid.forest.record(),
        "without_forest": solid.reason,
    }


def _times(runs: Runs, before: dict[str, float], benchmark: BenchmarkOptions) -> dict[str, Any]:
    """Medians, spreads and ratios; `before` is what the mesh alone needed."""
    every = {name: [run.seconds for run in results] for name, results in runs.items()}
    seconds = {name: float(np.median(each)) for name, each in every.items()}
    planned = {
        name: float(np.median([run.before for run in results])) for name, results in runs.items()
    }
    parts = {
        **before,
        "fine_solver": planned.get("fastest", 0.0),
        "coarse_solver": planned.get("ddfem_ec", 0.0),
    }
    # What only some rows have is not among the methods of the others.
    optional = ("rough", "arpack_regular", *RIVALS)
    names = [
        name
        for name, method in METHODS.items()
        if name in seconds or name in benchmark.further or method.option not in optional
    ]
    bases = {name: method.over for name, method in METHODS.items() if method.over}
    return {
        "seconds": {
            "precompute": sum(parts.values()),
            **{name: seconds.get(name) for name in names},
        },
        "spread": {name: {"min": min(each), "max": max(each)} for name, each in every.items()},
        "precompute_parts": parts,
        "phases": {name: results[-1].phases for name, results in runs.items()},
        "speedup": speedups(seconds, bases),
        "speedup_with_precompute": speedups(seconds, bases, planned),
    }


def _errors(runs: Runs, spectra: dict[str, MethodRun]) -> dict[str, Any]:
    fine = spectra["fine"].values
    names = {"average": "average", "ddfem": "coarse"}
    coarse = {name: spectra[key].values for name, key in names.items() if key in spectra}
    return {
        "eigenvalue_error": {
            name: spectrum_error(runs[name][-1].values, spectra[method.reference].values)
            for name, method in METHODS.items()
            if method.reference is not None and name in runs
        },
        "frequency_error": {name: tone_error(values, fine) for name, values in coarse.items()},
    }
