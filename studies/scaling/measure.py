"""One run on the ranks that there are, phase by phase."""

import os
import resource
import time
from contextlib import AbstractContextManager
from dataclasses import replace
from typing import Any, cast

import numpy as np

from carillon.arrays import Array
from carillon.fem.model import Solid
from carillon.processes.memory import reuse_freed_memory
from carillon.processes.mpi import MPI
from solver.analysis.bounds import check_mode_count, default_keep
from solver.analysis.components import distribute_by_parts, elastic_part
from solver.analysis.options import SolverOptions
from solver.assembly.system import Layout, System, assemble
from solver.correction.criteria import default_guard
from solver.correction.error_correction import correct
from solver.distribution.collective import bcast_from_root
from solver.distribution.redistribution import Redistribution
from solver.hcms.counts import Tally
from solver.hcms.synthesis import make_subdomains, synthesize
from solver.linear import Inverse, LinearSolver

REPEATS = 3
"""Runs of which the fastest is reported: what else runs on the machine only slows them."""
PINGS = 50
"""Messages that the link between two ranks is measured by."""
PING_SIZES = (8, 1 << 20)
"""Their sizes [bytes]."""


def measure(
    model: Solid | None, options: SolverOptions, comm: MPI.Comm = MPI.COMM_WORLD
) -> dict[str, Any]:
    """Time and count HCMS with error correction on the ranks of `comm`.

    A first run on few modes compiles what needs compiling; then the fastest of `REPEATS` counts.

    Raises UserError if there are too few unknowns for so many modes, or more ranks than subdomains.

    Returns plain values: `phases` with the seconds of each rank, and of the synthesis also waiting
    [s], flops, bytes and messages; `seconds` of all but the partition, `peak_memory_bytes` of each
    rank, `link` (latency [s], bandwidth [B/s] between two ranks; None on one), sizes, ranks and
    cores.
    """
    bcast_from_root(comm, lambda: check_mode_count(options.modes, cast(Solid, model).n_dofs))
    reuse_freed_memory()
    options = replace(options, method="hcms")
    _Run(model, replace(options, modes=min(20, options.modes), tolerance=0.0, corrections=1), comm)
    runs = [_Run(model, options, comm) for _ in range(REPEATS)]
    seconds = comm.bcast([run.seconds for run in runs])
    run = runs[int(np.argmin(seconds))]
    ends = comm.gather(_this_machine())
    machines = bcast_from_root(comm, lambda: dict(cast("list[tuple[str, int]]", ends)))
    cores = sum(machines.values())
    return {
        "ranks": comm.size,
        "cores": cores,
        "oversubscribed": comm.size > cores,
        "repeats": REPEATS,
        "seconds": min(seconds),
        "slowest_seconds": max(seconds),
        "n_dofs": run.by_parts.n_dofs,
        "modes": options.modes,
        "keep": run.keep,
        "width": run.width,
        "subdomains": run.by_parts.decomposition.tree.parts,
        "corrections": run.result.steps,
        "blocks": run.result.blocks,
        "right_hand_sides": run.result.solves,
        "linear_solver": run.linear.method,
        "phases": run.phases(),
        "peak_memory_bytes": comm.allgather(_peak_memory()),
        "link": _measure_link(comm),
    }


class _Run:
    """HCMS and error correction, each phase timed."""

    def __init__(self, model: Solid | None, options: SolverOptions, comm: MPI.Comm) -> None:
        self.comm = comm
        rigid = bcast_from_root(comm, lambda: cast(Solid, model).rigid_modes)
        requested = options.modes - rigid
        self.width = requested + default_guard(requested)
        self.own = {name: Tally() for name in ("partition", "assembly", "dense")}
        with self._phase("partition"):
            self.by_parts, local_mesh = distribute_by_parts(model, options, comm)
            parts = self.by_parts.decomposition.tree.parts
            self.keep = default_keep(options.modes, parts, together=True)
            layout = Layout.of_local_mesh(local_mesh, comm)
            subdomains = make_subdomains(self.by_parts, options.interface, comm)
            redistribution = Redistribution(self.by_parts, local_mesh, comm)
            self.linear = _TimedLinearSolver(options.linear_solver, layout)
        comm.barrier()
        begin = time.perf_counter()
        with self._phase("assembly"):
            system = assemble(local_mesh, comm, layout)
        comm.barrier()
        threads = system.rows.threads
        synthesis = synthesize(
            self.by_parts, self.keep, options.interface, comm, subdomains, threads
        )
        self.counts = synthesis.counts
        with self._phase("dense"):
            synthesis.vectors = redistribution.rows(synthesis.vectors)
            values, start = elastic_part(system, synthesis)
            self.result = correct(
                system,
                start,
                requested,
                self.linear,
                values,
                tolerance=cast(float, options.tolerance),
                max_steps=options.corrections,
            )
        comm.barrier()
        self.seconds = time.perf_counter() - begin
        system.destroy()

    def _phase(self, name: str) -> AbstractContextManager[None]:
        """Time the body of a phase that all ranks begin together."""
        self.comm.barrier()
        return self.own[name].running()

    def phases(self) -> dict[str, dict[str, list[float]]]:
        """Every phase's quantities, one a rank; collective."""
        factor, solving = self.linear.factor.seconds, self.linear.solving.seconds
        own = {name: tally.seconds for name, tally in self.own.items()}
        own = {**own, "dense": own["dense"] - factor - solving, "factor": factor, "solve": solving}
        everyone = self.comm.allgather(own)
        seconds = {name: {"seconds": [each[name] for each in everyone]} for name in own}
        synthesis = {
            phase: {name: values.tolist() for name, values in quantities.items()}
            for phase, quantities in self.counts.per_rank(self.comm).items()
        }
        first = {name: seconds.pop(name) for name in ("partition", "assembly")}
        return {**first, **synthesis, **seconds}


class _TimedLinearSolver(LinearSolver):
    """A linear solver whose factorisations and solves on this rank are timed."""

    def __init__(self, method: str, layout: Layout) -> None:
        super().__init__(method, layout)
        self.factor, self.solving = Tally(), Tally()

    def inverse(self, system: System, shift: float) -> Inverse:
        """Inverse whose making is timed, and whose solves will be."""
        with self.factor.running():
            inverse = super().inverse(system, shift)
        return _TimedInverse(inverse, self.solving)


class _TimedInverse:
    def __init__(self, inverse: Inverse, tally: Tally) -> None:
        self.shift, self.exact, self.negative = inverse.shift, inverse.exact, inverse.negative
        self._inverse, self._tally = inverse, tally

    def solve(self, block: Array) -> Array:
        with self._tally.running():
            return self._inverse.solve(block)

    def destroy(self) -> None:
        self._inverse.destroy()


def _this_machine() -> tuple[str, int]:
    return MPI.Get_processor_name(), len(os.sched_getaffinity(0))


def _peak_memory() -> float:
    return 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def _measure_link(comm: MPI.Comm) -> dict[str, float] | None:
    """Latency [s] and bandwidth [B/s] of messages between ranks 0 and 1, in a quiet moment."""
    if comm.size == 1:
        return None
    small, large = (_ping(comm, size) for size in PING_SIZES)
    comm.barrier()
    per_byte = max(large - small, 1e-12) / (PING_SIZES[1] - PING_SIZES[0])
    measured: dict[str, float] = comm.bcast({"latency": small, "bandwidth": 1.0 / per_byte})
    return measured


def _ping(comm: MPI.Comm, size: int) -> float:
    """Median time [s] of one message of `size` bytes."""
    buffer = np.zeros(size, dtype=np.uint8)
    seconds = []
    for _ in range(PINGS):
        begin = time.perf_counter()
        if comm.rank == 0:
            comm.Send(buffer, dest=1)
            comm.Recv(buffer, source=1)
        elif comm.rank == 1:
            comm.Recv(buffer, source=0)
            comm.Send(buffer, dest=0)
        seconds.append(0.5 * (time.perf_counter() - begin))
    return float(np.median(seconds))
