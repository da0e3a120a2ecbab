"""Rate the distances from the solid that spectra expect by spectra of a much finer lattice."""

import argparse

from carillon.parameters.command_line import add_options, collect
from solver.commands.running import add_outputs, on_ranks, require_outputs, tell_measured
from studies.accuracy.distance import OBJECTS, DistanceStudyOptions, as_text, measure_distances

EXAMPLES = """example:
  distance builtin:bell builtin:frying-pan --turned --out distances.json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument(
        "files",
        nargs="*",
        default=list(OBJECTS),
        metavar="MESH",
        help="mesh files, or builtin:NAME (default: all built-in solids)",
    )
    add_options(parser, DistanceStudyOptions)
    add_outputs(parser)


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    with on_ranks():
        require_outputs(arguments)
        options = collect(DistanceStudyOptions, arguments)
        result = measure_distances(tuple(arguments.files), options)
        tell_measured(arguments, result, as_text)
