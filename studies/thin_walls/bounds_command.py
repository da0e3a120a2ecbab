"""Seek frequencies of finite cells that are below those of the solid, over lattices."""

import argparse

from carillon.parameters.command_line import add_options, collect
from solver.commands.running import add_outputs, on_ranks, require_outputs, tell_measured
from studies.thin_walls.bounds import BoundOptions, as_text, measure_bounds
from studies.thin_walls.names import add_solids, chosen_solids

EXAMPLES = """example:
  thin-wall-bounds --solids ring,skillet --resolution 24 --out bounds.json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_solids(parser)
    add_options(parser, BoundOptions)
    add_outputs(parser)


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    with on_ranks():
        require_outputs(arguments)
        result = measure_bounds(chosen_solids(arguments), collect(BoundOptions, arguments))
        tell_measured(arguments, result, as_text)
