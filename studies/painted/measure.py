"""Modes of materials that follow each other, of which only one part changes, by each method."""

import statistics
import time
from dataclasses import replace
from typing import Annotated, Any

import numpy as np

from carillon.arrays import Array
from carillon.command_line.progress import say
from carillon.fem.model import RIGID_MODES, ElasticModel
from carillon.parameters import option, parameters
from carillon.parameters.quantities import NumberOfModes, between
from carillon.processes.mpi import MPI
from solver.analysis.modal_solver import ModalSolver
from solver.analysis.modes import Modes
from solver.analysis.options import SolverOptions
from solver.correction.criteria import INTERACTIVE_TOLERANCE

METHODS = {
    "HCMS": SolverOptions(method="hcms", corrections=0),
    "HCMS + EC": SolverOptions(method="hcms", tolerance=INTERACTIVE_TOLERANCE),
    "block Lanczos": SolverOptions(method="lanczos", tolerance=INTERACTIVE_TOLERANCE),
}
"""Options of each method, but for the number of modes: the paper's, and what a design takes."""
FIRST_STEPS = 2
"""Number of steps that methods take to see that materials follow each other."""
TRUTH_TOLERANCE = 1e-6


@parameters
class PaintedOptions:
    """What is painted, and how often."""

    modes: NumberOfModes = option(64, "number of modes, rigid ones included")
    part: Annotated[float, between(0.001, 1.0)] = option(
        0.1, "share of the voxels that are painted, those at one end of the second axis [1]"
    )
    growth: Annotated[float, between(1.0, 10.0)] = option(
        1.25, "factor between their moduli of one step and the next [1]"
    )
    steps: Annotated[int, between(3, 1000)] = option(6, "steps, the first included")


def follow(model: ElasticModel, young: Array, options: PaintedOptions) -> dict[str, Any]:
    """Time every step by each method, on this process alone.

    Parameters
    ----------
    young
        (m,) Young's moduli [Pa] of the voxels before anything is painted.

    Returns
    -------
    dict[str, Any]
        `n_dofs`, `modes`, and by method `seconds` of each step, of the `first` and the median of
        the `following` ones, which begin with the third; and `median_error` and `largest_error`,
        relative, of the eigenvalues of the last step.
    """
    heights = model.mesh.nodes[model.connectivity, 1].mean(axis=1)
    painted = np.argsort(heights, kind="stable")[-max(1, round(options.part * len(young))) :]
    materials = []
    for step in range(options.steps):
        materials.append(young.copy())
        materials[-1][painted] *= options.growth**step
    truth = ModalSolver(
        model, SolverOptions(modes=options.modes, tolerance=TRUTH_TOLERANCE), MPI.COMM_SELF
    ).solve(materials[-1])
    methods = {}
    for name, chosen in METHODS.items():
        seconds, modes = _steps(model, replace(chosen, modes=options.modes), materials)
        ratios = modes.values[RIGID_MODES:] / truth.values[RIGID_MODES:]
        errors = np.abs(ratios - 1.0)
        methods[name] = {
            "seconds": seconds,
            "first": seconds[0],
            "following": statistics.median(seconds[FIRST_STEPS:]),
            "median_error": float(np.median(errors)),
            "largest_error": float(errors.max()),
        }
        say(f"{name}: {methods[name]['following']:.2f} s a step")
    return {"n_dofs": model.n_dofs, "modes": options.modes, "methods": methods}


def _steps(
    model: ElasticModel, options: SolverOptions, materials: list[Array]
) -> tuple[list[float], Modes]:
    """Wall seconds of each step, and the modes of the last one.

    Block Lanczos starts from the modes of the step before; HCMS keeps groups of subdomains.
    """
    ModalSolver(model, options, MPI.COMM_SELF).solve()  # compiles what needs compiling
    solver = ModalSolver(model, options, MPI.COMM_SELF)
    modes: Modes | None = None
    seconds = []
    for young in materials:
        begin = time.perf_counter()
        modes = solver.solve(young, initial_modes=modes if options.method == "lanczos" else None)
        seconds.append(time.perf_counter() - begin)
    assert modes is not None
    return seconds, modes


def lines_of(result: dict[str, Any]) -> list[str]:
    """A table of the result of `follow`, line by line."""
    lines = [
        f"{result['n_dofs']:,} unknowns, {result['modes']} modes; seconds of a step, and errors of "
        "eigenvalues",
        f"{'':14s} {'first':>8s} {'following':>10s} {'median':>9s} {'largest':>9s}",
    ]
    lines += [
        f"{name:14s} {each['first']:8.2f} {each['following']:10.2f} "
        f"{each['median_error']:9.1e} {each['largest_error']:9.1e}"
        for name, each in result["methods"].items()
    ]
    return lines
