"""Time one solid on several numbers of ranks, and model more of them.

It starts the ranks by itself; started on several ranks, it measures these.
"""

import argparse
import dataclasses
import json
from typing import Any

from carillon.parameters.command_line import add_options, collect
from carillon.processes.mpi import MPI
from carillon.records.measurement import measured
from solver.analysis.options import SolverOptions
from solver.analysis.problem import ProblemOptions, build_problem
from solver.commands.running import add_solid, on_ranks, parameters, require_outputs, write_json
from solver.distribution.collective import compute_on_root
from studies.scaling.measure import measure
from studies.scaling.runs import ScalingOptions, scaling_study, study_lines
from workflow.arguments import options

EXAMPLES = """example:
  scaling builtin:bell --resolution 40 --ranks 1,2,4 --plot scaling.svg
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_solid(parser)
    add_options(parser, ScalingOptions)
    parser.add_argument("--here", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--out", help="also write the result to this JSON file")
    parser.add_argument("--plot", help="figure to draw (PNG, SVG or PDF)")
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(arguments: argparse.Namespace) -> None:
    """Measure, model and print."""
    with on_ranks() as comm:
        require_outputs(arguments, comm)
        if arguments.here or comm.size > 1:
            result, lines = _measured_here(arguments, comm)
        else:
            how = collect(ScalingOptions, arguments)
            result = scaling_study(collect(ProblemOptions, arguments), how, _repeated(arguments))
            lines = study_lines(result)
            result["provenance"] = measured(parameters(arguments), how.ranks, threads=1)
        write_json(arguments, result, comm)
        if comm.rank:
            return
    if arguments.plot is not None and "strong" in result:
        from studies.scaling.plot import save_plot

        save_plot(result, arguments.plot)
    print(json.dumps(result, indent=2) if arguments.json else "\n".join(lines))


def _measured_here(
    arguments: argparse.Namespace, comm: MPI.Comm
) -> tuple[dict[str, Any], list[str]]:
    """What these ranks need for the solid."""
    described = collect(ProblemOptions, arguments)
    problem = compute_on_root(comm, lambda: build_problem(described))
    model = None if problem is None else problem.model
    result = measure(model, collect(SolverOptions, arguments), comm)
    result["provenance"] = measured(parameters(arguments), comm.size)
    return result, [f"{comm.size} ranks: {result['seconds']:.2f} s"]


def _repeated(arguments: argparse.Namespace) -> list[str]:
    """Arguments with which the same solid is solved again, but for mesh and resolution."""
    solid = {field.name for field in dataclasses.fields(ProblemOptions)} - {"mesh", "resolution"}
    names = (*sorted(solid), "modes", "tolerance", "linear_solver")
    return options({name: getattr(arguments, name) for name in names})
