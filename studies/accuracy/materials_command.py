"""Rate solids of several materials, of wood, and held ones by frequencies that no mesh made."""

import argparse

from carillon.parameters.command_line import add_options, collect
from solver.commands.running import add_outputs, on_ranks, require_outputs, tell_measured
from studies.accuracy.materials import MaterialStudyOptions, as_text, measure_materials

EXAMPLES = """example:
  materials --spacings 4 8 16 --out materials.json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_options(parser, MaterialStudyOptions)
    add_outputs(parser)


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    with on_ranks():
        require_outputs(arguments)
        result = measure_materials(collect(MaterialStudyOptions, arguments))
        tell_measured(arguments, result, as_text)
