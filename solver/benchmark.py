"""One row of the time table (Fig. 11): all methods on the same mesh, cores and run."""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from mpi4py import MPI

from carillon.progress import say
from solver.analysis import RIGID_MODES, SolverOptions, modal_analysis
from solver.decomposition import keep_on_root, on_root
from solver.modes_file import frequencies
from solver.problem import Problem, ProblemOptions, build_problem
from solver.trained import trained_or_reason


def benchmark_row(
    options: ProblemOptions,
    modes: int,
    runs: int = 3,
    arpack: bool = True,
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> dict[str, Any]:
    """Time every method on one solid.

    Each method runs `runs` times after one warm-up on a small number of modes; the median and the
    extremes are reported.  Time is that of partition, assembly and solution; voxelisation and
    material count as precomputation.  Errors are relative to the fine SLEPc spectrum.  Without
    forests, neither named nor default ones, `ddfem` is left out with a sentence.
    """
    plain = SolverOptions(modes=modes)
    methods: dict[str, tuple[str, SolverOptions]] = {
        "slepc": ("none", replace(plain, method="slepc", prove=False)),
        "hcms": ("none", replace(plain, corrections=0)),
        "hcms_ec": ("none", plain),
        "average_hcms_ec": ("average", plain),
    }
    if arpack:
        methods["arpack"] = ("none", replace(plain, method="arpack", prove=False))
    forest = on_root(comm, lambda: trained_or_reason(options.forest, options.poisson))
    if isinstance(forest, str):
        say(forest, visible=comm.rank == 0)
    else:
        methods["ddfem_slepc"] = ("ddfem", replace(plain, method="slepc", prove=False))
        methods["ddfem_hcms_ec"] = ("ddfem", plain)
    problems: dict[str, Problem | None] = {}
    seconds_before: dict[str, dict[str, float]] = {}
    for coarsen in dict.fromkeys(coarsen for coarsen, _ in methods.values()):
        problem = keep_on_root(comm, partial(build_problem, replace(options, coarsen=coarsen)))
        problems[coarsen] = problem
        seconds_before[coarsen] = comm.bcast(problem.seconds if problem else None)
    row: dict[str, Any] = {
        "mesh": options.mesh,
        "resolution": options.resolution,
        "material": options.material,
        "modes": modes,
        "ranks": comm.size,
        "runs": runs,
        "precomputation_seconds": sum(
            seconds_before["none"][phase] for phase in ("mesh", "material")
        ),
        "methods": {},
    }
    exact = None
    for name, (coarsen, solver) in methods.items():
        problem = problems[coarsen]
        model = problem.model if problem else None
        modal_analysis(model, replace(solver, modes=min(20, modes)), comm).system.destroy()
        seconds = []
        for _ in range(runs):
            comm.barrier()
            begin = time.perf_counter()
            result = modal_analysis(model, solver, comm)
            comm.barrier()
            elapsed = time.perf_counter() - begin - result.seconds["verification"]
            seconds.append(elapsed + seconds_before[coarsen].get("coarsening", 0.0))
            result.system.destroy()
        found = frequencies(result.values)[RIGID_MODES:]
        exact = found if exact is None else exact
        error = found / exact - 1.0
        entry = {
            "n_dofs": result.system.n_dofs,
            "seconds_median": float(np.median(seconds)),
            "seconds_min": min(seconds),
            "seconds_max": max(seconds),
            "frequency_rms_relative_error": float(np.sqrt(np.mean(error**2))),
            "residual_max": float(result.residuals.max()),
        }
        row["methods"][name] = entry
        say(
            f"{name:<16s} {entry['n_dofs']:>8,d} unknowns {entry['seconds_median']:8.2f} s "
            f"({min(seconds):.2f} to {max(seconds):.2f})  frequency error "
            f"{100 * entry['frequency_rms_relative_error']:.3g} %",
            visible=comm.rank == 0,
        )
    return row
