"""Rate finite cells on thin curved walls by frequencies that no cell made, over size and time."""

import argparse

from carillon.parameters.command_line import add_options, collect
from solver.commands.running import add_outputs, on_ranks, require_outputs, tell_measured
from studies.thin_walls.measure import ThinWallOptions, as_text, measure_thin_walls
from studies.thin_walls.names import add_solids, chosen_solids

EXAMPLES = """example:
  thin-walls --solids ring,wine-glass --levels 3 --out thin_walls.json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_solids(parser)
    add_options(parser, ThinWallOptions)
    add_outputs(parser)


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    with on_ranks():
        require_outputs(arguments)
        result = measure_thin_walls(chosen_solids(arguments), collect(ThinWallOptions, arguments))
        tell_measured(arguments, result, as_text)
