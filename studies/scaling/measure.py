"""One run on the ranks that there are, phase by phase."""

from __future__ import annotations

import os
import resource
import time
from dataclasses import astuple, fields, replace
from typing import Any, cast

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from carillon.fem.model import RIGID_MODES, Solid
from carillon.processes.cores import reuse_freed_memory
from solver.analysis.bounds import check_mode_count, default_keep
from solver.analysis.components import elastic_part
from solver.analysis.options import SolverOptions
from solver.assembly.system import Layout, System, assemble
from solver.correction.correct import correct
from solver.correction.correction import Correction, default_guard
from solver.distribution.collective import bcast_from_root
from solver.distribution.local_mesh import LocalMesh, distribute
from solver.hcms.counts import Counts, Tally
from solver.hcms.synthesis import make_subdomains, synthesize
from solver.linear import LinearSolver
from studies.scaling.counting import CountingComm, TimedLinearSolver
from studies.scaling.work import assembly_flops, dense_flops, elimination

Phases = dict[str, dict[str, list[float]]]

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

    Returns
    -------
    dict[str, Any]
        Plain values: `phases` with seconds, waiting [s], flops, bytes and messages of each rank,
        `seconds` of all but the partition, `peak_memory_bytes` of each rank, `link` (latency [s],
        bandwidth [B/s] between two ranks; None on one), sizes, ranks and cores.

    Raises
    ------
    UserError
        If there are too few unknowns for so many modes, or more ranks than subdomains.
    """
    bcast_from_root(comm, lambda: check_mode_count(options.modes, cast(Solid, model).n_dofs))
    reuse_freed_memory()
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
        "n_dofs": run.local_mesh.n_dofs,
        "modes": options.modes,
        "keep": run.keep,
        "width": run.width,
        "subdomains": run.local_mesh.decomposition.tree.parts,
        "corrections": run.result.steps,
        "blocks": run.result.blocks,
        "right_hand_sides": run.result.solves,
        "linear_solver": run.linear.method,
        "phases": run.phases(model),
        "peak_memory_bytes": _everyones(comm, [_peak_memory()])[:, 0].tolist(),
        "link": _measure_link(comm),
    }


class _Run:
    """HCMS and error correction with a tally for every phase."""

    def __init__(self, model: Solid | None, options: SolverOptions, comm: MPI.Comm) -> None:
        self.comm = CountingComm.of(comm)
        requested = options.modes - RIGID_MODES
        self.width = requested + default_guard(requested)
        with self._phase() as self.partition:
            self.local_mesh: LocalMesh = distribute(model, None, options.seed, self.comm)
            parts = self.local_mesh.decomposition.tree.parts
            self.keep = default_keep(options.modes, parts, together=True)
            layout = Layout.of_local_mesh(self.local_mesh, self.comm)
            subdomains = make_subdomains(self.local_mesh, options.interface, self.comm)
            self.linear = TimedLinearSolver.of(LinearSolver(options.linear_solver, layout))
        begin = self._together()
        with self._phase() as self.assembly:
            system: System = assemble(self.local_mesh, self.comm, layout)
        self.comm.barrier()
        synthesis = synthesize(
            self.local_mesh,
            self.keep,
            options.interface,
            self.comm,
            subdomains,
            system.rows.threads,
        )
        self.counts: Counts = synthesis.counts
        self.comm.barrier()
        with self._phase() as self.correction:
            values, start = elastic_part(system, synthesis)
            self.result: Correction = correct(
                system,
                start,
                requested,
                self.linear,
                values,
                tolerance=cast(float, options.tolerance),
                max_steps=options.corrections,
            )
        self.seconds = self._together() - begin
        system.destroy()

    def _together(self) -> float:
        """Time at which all ranks are here."""
        self.comm.barrier()
        return time.perf_counter()

    def _phase(self) -> Any:
        self.comm.barrier()
        return self.comm.phase()

    def phases(self, model: Solid | None) -> Phases:
        """Every phase's quantities, one a rank; collective."""
        factor, solving = self.linear.factor, self.linear.solving
        dense = self.correction
        dense.seconds -= factor.seconds + solving.seconds
        self._count_flops(model)
        tallies = {
            "partition": self.partition,
            "assembly": self.assembly,
            **self.counts.phases(),
            "factor": factor,
            "solve": solving,
            "dense": dense,
        }
        everyone = _everyones(self.comm, [list(astuple(tally)) for tally in tallies.values()])
        return {
            phase: {
                field.name: everyone[:, row, column].tolist()
                for column, field in enumerate(fields(Tally))
            }
            for row, phase in enumerate(tallies)
        }

    def _count_flops(self, model: Solid | None) -> None:
        ranks = self.comm.size
        work = bcast_from_root(self.comm, lambda: elimination(cast(Solid, model)))
        shared, alone = dense_flops(
            self.local_mesh.n_dofs, self.result.blocks, self.result.solves, self.width
        )
        self.assembly.flops = assembly_flops(self.local_mesh.cells.elements)
        self.linear.factor.flops = work.flops / ranks
        self.linear.solving.flops = work.solve_flops(self.result.solves) / ranks
        own = 3 * (self.local_mesh.stop - self.local_mesh.start) / self.local_mesh.n_dofs
        self.correction.flops = own * shared + (alone if self.comm.rank == 0 else 0.0)


def _everyones(comm: MPI.Comm, mine: list[Any]) -> NDArray[np.float64]:
    """Arrays of all ranks, stacked; the same on every rank."""
    return np.array(comm.allgather(mine), dtype=float)


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
