"""Rate models of solids whose frequencies were measured or published."""

import argparse

from carillon.parameters.command_line import add_options, collect
from solver.commands.running import add_outputs, on_ranks, require_outputs, tell_measured
from studies.measured.measure import MeasuredOptions, as_text, measure_solids

EXAMPLES = """example:
  measured --solids titanium-block,tuning-fork --out measured.json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_options(parser, MeasuredOptions)
    add_outputs(parser)


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    with on_ranks():
        require_outputs(arguments)
        result = measure_solids(collect(MeasuredOptions, arguments))
        tell_measured(arguments, result, as_text)
