"""Time the steps of a design that paints one part of a solid again and again, by each method."""

import argparse

from carillon.parameters.command_line import add_options, collect
from solver.analysis.problem import ProblemOptions, build_problem
from solver.commands.running import (
    COMPOSED,
    add_outputs,
    add_voxels,
    on_ranks,
    require_outputs,
    tell_measured,
)
from studies.painted.measure import PaintedOptions, follow, lines_of

EXAMPLES = """example:
  painted builtin:bell --resolution 32 --material smooth --modes 64
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_voxels(parser, *COMPOSED)
    add_options(parser, PaintedOptions)
    add_outputs(parser)


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    with on_ranks() as comm:
        require_outputs(arguments, comm)
        problem = build_problem(collect(ProblemOptions, arguments))
        result = follow(problem.hexahedra, problem.young, collect(PaintedOptions, arguments))
        tell_measured(arguments, result, lambda found: "\n".join(lines_of(found)), comm)
