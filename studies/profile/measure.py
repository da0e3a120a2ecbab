"""Where the time of a modal analysis goes: rates of its phases, of dgemm and of the memory.

What `--method auto` does on one rank is done again step by step, with the shift and the number of
blocks that it found: the factorisation, the block Lanczos iteration with its solves and products,
the Ritz vectors and the verification.
"""

import statistics
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Annotated, Any, cast

import numpy as np

from carillon.arrays import Array
from carillon.errors import UserError
from carillon.fem.model import RIGID_MODES, Solid
from carillon.parameters import option, parameters
from carillon.parameters.quantities import NumberOfModes, between
from carillon.processes.mpi import MPI
from carillon.processes.threads import in_parallel, split
from solver.analysis.modal_solver import ModalSolver
from solver.analysis.options import SolverOptions
from solver.assembly.system import Layout, System
from solver.correction.criteria import EIGENVALUE_TOLERANCE, accurate_count, carried_count
from solver.correction.krylov import KrylovBasis
from solver.correction.random_start import from_nothing
from solver.linear import Inverse, LinearSolver
from solver.linear.plan import Plan
from solver.subspace.start import start_block
from solver.subspace.weyl import CountingLaw
from solver.verification.residuals import verify

MATRIX = 3000
"""Rows of the matrices whose product tells the rate of dgemm."""
COPIED = 40_000_000
"""Numbers whose copy tells the rate of the memory."""
RATE_RUNS = 5
MASS_OPERATIONS, STIFFNESS_OPERATIONS = 6, 18
"""Operations of a pair of nodes in a product with one vector."""


@parameters
class ProfileOptions:
    """How a profile is measured."""

    modes: NumberOfModes = option(256, "number of modes, rigid ones included")
    runs: Annotated[int, between(1, 1000)] = option(5, "runs of which medians are taken")


Phase = dict[str, float]
"""What a phase took: `seconds` of wall time, floating-point `operations`, and `bytes` moved between
memory and processor at least; 0 if not known."""


@dataclass
class _Meter:
    """Phases of one run; what is measured within another phase does not count for that."""

    phases: dict[str, Phase] = field(default_factory=dict)
    _inner: list[float] = field(default_factory=list)

    @contextmanager
    def __call__(self, name: str, operations: float = 0.0, moved: float = 0.0) -> Iterator[None]:
        self._inner.append(0.0)
        begin = time.perf_counter()
        yield
        whole = time.perf_counter() - begin
        took = {"seconds": whole - self._inner.pop(), "operations": operations, "bytes": moved}
        before = self.phases.get(name, {})
        self.phases[name] = {key: before.get(key, 0.0) + each for key, each in took.items()}
        if self._inner:
            self._inner[-1] += whole


class _MeteredSystem:
    """A system whose products are measured."""

    def __init__(self, system: System, meter: _Meter) -> None:
        self._system, self._meter = system, meter

    def __getattr__(self, name: str) -> Any:
        return getattr(self._system, name)

    def times_mass(self, block: Array) -> Array:
        """See `System.times_mass`."""
        entries = self._system.rows.mass
        work = float(MASS_OPERATIONS * len(entries) * block.shape[1])
        with self._meter("mass products", work, entries.nbytes + 2.0 * block.nbytes):
            return self._system.times_mass(block)

    def inner(self, left: Array, right: Array) -> Array:
        """See `System.inner`."""
        work = 2.0 * left.shape[0] * left.shape[1] * right.shape[1]
        with self._meter("inner products", work, left.nbytes + right.nbytes):
            return self._system.inner(left, right)


class _MeteredInverse:
    """An inverse whose solves are measured."""

    def __init__(self, inverse: Inverse, plan: Plan, meter: _Meter) -> None:
        self._inverse, self._plan, self._meter = inverse, plan, meter
        self.shift, self.negative = inverse.shift, inverse.negative

    def solve(self, block: Array) -> Array:
        """See `Inverse.solve`."""
        plan = self._plan
        work = plan.operations_of_solve * block.shape[1]
        # Up and down the tree.
        with self._meter("solves", work, 2.0 * (plan.bytes - plan.bytes_of_updates)):
            return self._inverse.solve(block)


def profile(model: Solid, options: ProfileOptions, seed: int = 0) -> dict[str, Any]:
    """Measure the phases of `--method auto` on one rank; `seed` is that of the random vectors.

    Raises UserError, see `ModalSolver`; also if the solid is too large to be factorised.

    Returns plain values: sizes, and columns of a `block` of right-hand sides; `threads`, and of how
    many `runs` medians are taken; `seconds` from moduli to verified modes by `ModalSolver.solve`;
    `phases` by name, see `Phase`; rates of a product of large matrices and of a copy (read and
    written) on all threads.
    """
    asked = SolverOptions(modes=options.modes, seed=seed)
    solver = ModalSolver(model, asked, MPI.COMM_SELF)
    if solver.options.method != "lanczos":
        raise UserError(
            f"{model.n_dofs:,} unknowns are too many to be factorised in the free memory; a "
            "profile of the method for fewer is all there is: lower --resolution"
        )
    whole = []
    for _ in range(1 + options.runs):
        solution, seconds = _timed(solver.solve)
        whole.append(seconds)
        system = solution.system
        del solution  # whose memory the next one takes over
    layout = Layout.of_local_mesh(solver.local_mesh, MPI.COMM_SELF)
    linear = LinearSolver("multifrontal", layout)
    threads = system.rows.threads
    elastic = options.modes - RIGID_MODES
    law = CountingLaw.of_solid(model, model.young, options.modes)
    width = carried_count(elastic, EIGENVALUE_TOLERANCE)
    accurate = accurate_count(elastic, EIGENVALUE_TOLERANCE)
    cold = from_nothing(system, linear, elastic, accurate, width, law, EIGENVALUE_TOLERANCE, seed)
    lanczos, shift = cold.result, cold.inverse.shift
    cold.inverse.destroy()
    del cold
    start = start_block(system, -(-lanczos.solves // lanczos.blocks), seed)
    meters = []
    for _ in range(options.runs):
        meters.append(_Meter())
        _replay(system, linear, shift, start, lanczos.blocks, width, meters[-1])
    phases = {
        name: phase
        | {"seconds": statistics.median(meter.phases[name]["seconds"] for meter in meters)}
        for name, phase in meters[0].phases.items()
    }
    return {
        "n_dofs": model.n_dofs,
        "modes": options.modes,
        "right_hand_sides": lanczos.solves,
        "block": start.shape[1],
        "threads": threads,
        "runs": options.runs,
        "seconds": statistics.median(whole[1:]),
        "phases": phases,
        "gflops_dgemm": dgemm_rate(),
        "gbytes_memory": memory_rate(threads),
    }


def _timed(solve: Callable[[], Any]) -> tuple[Any, float]:
    begin = time.perf_counter()
    result = solve()
    return result, time.perf_counter() - begin


def _replay(
    system: System,
    linear: LinearSolver,
    shift: float,
    start: Array,
    blocks: int,
    width: int,
    meter: _Meter,
) -> None:
    """The steps of a solve, each measured."""
    rows, plan = len(start), linear.tree.plan
    with meter("factorisation", plan.operations, plan.bytes - plan.bytes_of_updates):
        inverse = linear.inverse(system, shift)
    measured = cast(System, _MeteredSystem(system, meter))
    solver = cast(Inverse, _MeteredInverse(inverse, plan, meter))
    with meter("orthogonalisation"):
        basis = KrylovBasis(measured, solver, start.copy(), (blocks + 1) * start.shape[1])
    for _ in range(blocks):
        vectors = basis.size + RIGID_MODES + start.shape[1]
        work = 4.0 * rows * vectors * start.shape[1]
        with meter("orthogonalisation", work, 2.0 * 8 * rows * vectors):
            basis.extend()
    with meter("Ritz values"):
        basis.outlook(width)
    vectors = basis.size + RIGID_MODES + start.shape[1]
    with meter("Ritz vectors", 2.0 * rows * vectors * width, 8.0 * rows * (vectors + width)):
        values, modes = basis.ritz_pairs(width)
    inverse.destroy()
    entries = len(system.rows.mass)
    work = (MASS_OPERATIONS + STIFFNESS_OPERATIONS) * entries + 2.0 * rows * width
    with meter("verification", work * width):
        verify(system, values, modes)


def dgemm_rate() -> float:
    """GFLOP/s of a product of large matrices by numpy's BLAS; median."""
    left, right = np.random.default_rng(0).random((2, MATRIX, MATRIX))
    out = left @ right
    seconds = [_timed(lambda: np.matmul(left, right, out=out))[1] for _ in range(RATE_RUNS)]
    return 2e-9 * MATRIX**3 / statistics.median(seconds)


def memory_rate(threads: int) -> float:
    """GB/s read and written by a copy on some threads; median."""
    source, target = np.ones(COPIED), np.ones(COPIED)
    parts = [(start, stop) for start, stop in split(COPIED, threads, COPIED)]

    def copy() -> None:
        in_parallel(lambda a, b: np.copyto(target[a:b], source[a:b]), parts, threads)

    seconds = [_timed(copy)[1] for _ in range(1 + RATE_RUNS)][1:]
    return 2e-9 * source.nbytes / statistics.median(seconds)


def profile_lines(result: dict[str, Any]) -> list[str]:
    """The result as a table."""
    lines = [
        f"{result['n_dofs']:,} unknowns, {result['modes']} modes: {result['right_hand_sides']} "
        f"right-hand sides in blocks of {result['block']}, {result['threads']} threads; dgemm "
        f"{result['gflops_dgemm']:.0f} GFLOP/s, memory {result['gbytes_memory']:.1f} GB/s",
        f"{'phase':<20}{'s':>8}{'share':>8}{'GFLOP/s':>9}{'dgemm':>7}{'GB/s':>9}{'memory':>7}",
    ]
    phases = result["phases"]
    rest = result["seconds"] - sum(phase["seconds"] for phase in phases.values())
    others = {"assembly, checks": {"seconds": max(rest, 0.0), "operations": 0.0, "bytes": 0.0}}
    for name, phase in {**phases, **others}.items():
        seconds = phase["seconds"]
        line = f"{name:<20}{seconds:>8.3f}{seconds / result['seconds']:>8.0%}"
        line += _rate(phase["operations"], seconds, result["gflops_dgemm"])
        line += _rate(phase["bytes"], seconds, result["gbytes_memory"])
        lines.append(line.rstrip())
    return [*lines, f"{'whole solve':<20}{result['seconds']:>8.3f}"]


def _rate(amount: float, seconds: float, best: float) -> str:
    """Billions a second, and their share of the best; blank if they are not known."""
    if not amount:
        return " " * 16
    rate = 1e-9 * amount / seconds
    return f"{rate:>9.1f}{rate / best:>7.0%}"
