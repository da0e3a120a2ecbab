"""Time the factorisation of K - shift M and its solves by Carillon and by other direct solvers."""

import argparse

from carillon.parameters.command_line import add_options, collect
from solver.analysis.problem import ProblemOptions, build_problem
from solver.commands.running import add_outputs, add_solid, on_ranks, require_outputs, tell_measured
from studies.benchmark.direct import DirectOptions, compare, table_lines

EXAMPLES = """examples:
  benchmark-direct builtin:bell --resolution 32 --definite
  OMP_NUM_THREADS=1 benchmark-direct bunny.obj --resolution 48 --solvers own pardiso
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_solid(parser)
    add_options(parser, DirectOptions)
    add_outputs(parser)


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    with on_ranks() as comm:
        require_outputs(arguments, comm)
        described = collect(ProblemOptions, arguments)
        model = build_problem(described).model
        result = compare(model, collect(DirectOptions, arguments), described.seed)
        tell_measured(arguments, result, lambda found: "\n".join(table_lines(found)), comm)
