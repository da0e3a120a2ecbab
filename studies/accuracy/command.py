"""Rate voxels, finite cells and tetrahedra by frequencies that no mesh made, over size and time."""

import argparse

from carillon.parameters.command_line import add_options, collect
from solver.commands.running import add_outputs, on_ranks, require_outputs, tell_measured
from studies.accuracy.measure import AccuracyOptions, as_text, measure_accuracy

EXAMPLES = """example:
  accuracy --solids plate,sphere --levels 3 --out accuracy.json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_options(parser, AccuracyOptions)
    add_outputs(parser)


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    with on_ranks():
        require_outputs(arguments)
        result = measure_accuracy(collect(AccuracyOptions, arguments))
        tell_measured(arguments, result, as_text)
