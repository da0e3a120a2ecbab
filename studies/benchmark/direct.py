"""The factorisation of K - shift M and its solves, by Carillon and by other direct solvers."""

import statistics
import time
from collections.abc import Callable
from functools import partial
from typing import Annotated, Any

import numpy as np

from carillon.arrays import Array
from carillon.errors import ConvergenceError
from carillon.fem.model import Solid
from carillon.parameters import OneOf, option, parameters
from carillon.parameters.quantities import NumberOfModes, between
from carillon.processes.mpi import MPI
from carillon.processes.threads import allowed_threads
from solver.analysis.modal_solver import Prepared
from solver.correction.shift import inverse_amid
from solver.subspace.rayleigh_ritz import safe_shift
from solver.subspace.weyl import CountingLaw
from studies.benchmark.direct_solver import DirectSolver
from studies.benchmark.direct_solvers import SOLVERS, ShiftedSystem

COLUMNS = 192
"""Number of right-hand sides."""
BLOCKS = (24, 64)
"""Numbers of right-hand sides that are solved for together: those of block Lanczos, and more."""
BYTES = 8
"""Size of an entry of a factor."""

Steps = dict[str, tuple[float, float]]
"""Wall and processor seconds [s] of each step."""


@parameters
class DirectOptions:
    """How direct solvers are compared."""

    definite: bool = option(
        False, "a shift below all eigenvalues, which CHOLMOD needs, instead of one amid the modes"
    )
    modes: NumberOfModes = option(256, "number of modes amid which the shift lies")
    runs: Annotated[int, between(1, 1000)] = option(3, "runs of which medians are taken")
    warm_up: bool = option(True, "one more run before these, which does not count")
    solvers: tuple[Annotated[str, OneOf(*SOLVERS)], ...] | None = option(
        None, "those to be compared (default: all)"
    )


def compare(model: Solid, options: DirectOptions, seed: int = 0) -> dict[str, Any]:
    """Measure every solver on one rank; `seed` is that of the right-hand sides.

    Returns plain values: `n_dofs`, `shift` [rad^2/s^2], `threads`, `runs`; in `solvers` a row for
    each, see `_row`; in `failed` why others have none.
    """
    threads = allowed_threads()
    prepared = Prepared.of_model(model, MPI.COMM_SELF)
    system = prepared.assembled(threads)
    if options.definite:
        shift = -safe_shift(system)
    else:
        law = CountingLaw.of_solid(model, model.young, options.modes)
        shift = inverse_amid(system, prepared.linear, options.modes, law).shift
    shifted = ShiftedSystem(prepared.layout, system, shift)
    rhs = np.random.default_rng(seed).standard_normal((system.n_dofs, COLUMNS))
    rows, failed = {}, {}
    for name in options.solvers or SOLVERS:
        try:
            rows[name] = _row(SOLVERS[name], shifted, rhs, options)
        except ConvergenceError as error:
            failed[name] = str(error)
    return {
        "n_dofs": system.n_dofs,
        "shift": shift,
        "right_hand_sides": COLUMNS,
        "threads": threads,
        "runs": options.runs,
        "solvers": rows,
        "failed": failed,
    }


def _row(
    make: Callable[[ShiftedSystem], DirectSolver],
    shifted: ShiftedSystem,
    rhs: Array,
    options: DirectOptions,
) -> dict[str, Any]:
    """One solver's line of the table.

    Medians of the seconds of each step, as `wall_analysis` and `processor_solves_24`; `gigaflop` of
    a factorisation by the solver's own count, and its rates by wall time, `gflops`, and by
    processor time, `gflops_core`, all None if it does not count; `bytes` of the factor; `residual`,
    the largest |b - A x| / |b| in the 2-norm.
    """
    runs: list[Steps] = []
    residual, operations = 0.0, None
    for number in range(options.warm_up + options.runs):
        solver = make(shifted)
        try:
            took, worst = _run(solver, shifted, rhs)
            operations = solver.operations if operations is None else operations
        finally:
            solver.destroy()
        if solver.first_factorises:
            both, one = took["analysis"], took["factorisation"]
            took["analysis"] = max(both[0] - one[0], 0.0), max(both[1] - one[1], 0.0)
        residual = max(residual, worst)
        if number >= options.warm_up:
            runs.append(took)
    medians = {
        f"{kind}_{name}": statistics.median(took[name][index] for took in runs)
        for name in runs[0]
        for index, kind in enumerate(("wall", "processor"))
    }
    gigaflop = None if operations is None else 1e-9 * operations
    return medians | {
        "gigaflop": gigaflop,
        "gflops": gigaflop and gigaflop / medians["wall_factorisation"],
        "gflops_core": gigaflop and gigaflop / medians["processor_factorisation"],
        "bytes": BYTES * solver.entries,
        "residual": residual,
    }


def _run(solver: DirectSolver, shifted: ShiftedSystem, rhs: Array) -> tuple[Steps, float]:
    """What each step took, and the largest relative residual of a solution."""
    took = {"analysis": _timed(solver.analyse)[1], "factorisation": _timed(solver.factorise)[1]}
    worst = 0.0
    for width in BLOCKS:
        starts = range(0, COLUMNS, width)
        blocks = [np.array(rhs[:, start : start + width], order=solver.order) for start in starts]
        solved, took[f"solves_{width}"] = _timed(partial(_solve, solver, blocks))
        for block, solution in zip(blocks, solved, strict=True):
            left = np.linalg.norm(block - shifted.matrix @ solution, axis=0)
            worst = max(worst, float((left / np.linalg.norm(block, axis=0)).max()))
    return took, worst


def _solve(solver: DirectSolver, blocks: list[Array]) -> list[Array]:
    return [solver.solve(block) for block in blocks]


def _timed(work: Callable[[], Any]) -> tuple[Any, tuple[float, float]]:
    """What `work` returns, and the wall and processor seconds [s] of this process that it took."""
    begin = time.perf_counter(), time.process_time()
    result = work()
    return result, (time.perf_counter() - begin[0], time.process_time() - begin[1])


def table_lines(result: dict[str, Any]) -> list[str]:
    """The result as a table: wall / processor seconds of each step, one line a solver."""
    steps = ["analysis", "factorisation", *(f"solves_{width}" for width in BLOCKS)]
    titles = ["analysis", "factorisation", *(f"in blocks of {width}" for width in BLOCKS)]
    lines = [
        f"{result['n_dofs']:,} unknowns, shift {result['shift']:.3g} rad^2/s^2, "
        f"threads: {result['threads']}; wall / processor seconds, solves those of all "
        f"{result['right_hand_sides']} right-hand sides; GFlop/s by wall and, a core, by processor "
        "time; residual |b - A x| / |b|",
        f"{'':<9}"
        + "".join(f"{title:>17}" for title in titles)
        + f"{'GFlop':>9}{'GFlop/s':>9}{'a core':>8}{'GB':>7}{'residual':>10}",
    ]
    for name, row in result["solvers"].items():
        seconds = (f"{row[f'wall_{step}']:.3f} / {row[f'processor_{step}']:.3f}" for step in steps)
        rates = [
            "" if row[key] is None else f"{row[key]:.3g}"
            for key in ("gigaflop", "gflops", "gflops_core")
        ]
        lines.append(
            f"{name:<9}"
            + "".join(f"{each:>17}" for each in seconds)
            + f"{rates[0]:>9}{rates[1]:>9}{rates[2]:>8}"
            + f"{1e-9 * row['bytes']:>7.2g}{row['residual']:>10.1e}"
        )
    return lines + [f"{name}: {reason}" for name, reason in result["failed"].items()]
