"""Time the factorisation of K - shift M and its solves by Carillon and by other direct solvers."""

import argparse
import json

from carillon.parameters.command_line import add_options, collect
from carillon.records.measurement import measured
from solver.analysis.problem import ProblemOptions, build_problem
from solver.commands.running import add_solid, on_ranks, parameters, require_outputs, write_json
from studies.benchmark.direct import DirectOptions, compare, table_lines

EXAMPLES = """examples:
  benchmark-direct builtin:bell --resolution 32 --definite
  OMP_NUM_THREADS=1 benchmark-direct bunny.obj --resolution 48 --solvers own pardiso
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_solid(parser)
    add_options(parser, DirectOptions)
    parser.add_argument("--out", help="also write the result to this JSON file")
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    with on_ranks() as comm:
        require_outputs(arguments, comm)
        described = collect(ProblemOptions, arguments)
        model = build_problem(described).model
        result = compare(model, collect(DirectOptions, arguments), described.seed)
        result["provenance"] = measured(parameters(arguments))
        write_json(arguments, result, comm)
    print(json.dumps(result, indent=2) if arguments.json else "\n".join(table_lines(result)))
