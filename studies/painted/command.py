"""Time the steps of a design that paints one part of a solid again and again, by each method."""

import argparse
import json

from carillon.parameters.command_line import add_options, collect
from carillon.records.measurement import measured
from solver.analysis.problem import ProblemOptions, build_problem
from solver.commands.running import add_voxels, on_ranks, parameters, require_outputs, write_json
from studies.painted.measure import PaintedOptions, follow, lines_of

EXAMPLES = """example:
  painted builtin:bell --resolution 32 --material smooth --modes 64
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_voxels(parser)
    add_options(parser, PaintedOptions)
    parser.add_argument("--out", help="also write the result to this JSON file")
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    with on_ranks() as comm:
        require_outputs(arguments, comm)
        problem = build_problem(collect(ProblemOptions, arguments))
        result = follow(problem.hexahedra, problem.young, collect(PaintedOptions, arguments))
        result["provenance"] = measured(parameters(arguments))
        write_json(arguments, result, comm)
    print(json.dumps(result, indent=2) if arguments.json else "\n".join(lines_of(result)))
