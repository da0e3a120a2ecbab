"""Time the factorisation of K - shift M and its solves by Carillon and by other direct solvers."""

import argparse

from carillon.parameters.command_line import add_options
from solver.commands.running import add_outputs, add_solid, measure_solid
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
    measure_solid(arguments, DirectOptions, compare, table_lines)
