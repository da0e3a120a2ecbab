"""Rate the distances from the solid that spectra expect by spectra of a much finer lattice."""

import argparse
import json

from carillon.parameters.command_line import add_options, collect
from carillon.records.measurement import measured
from solver.commands.running import on_ranks, parameters, require_outputs, write_json
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
    parser.add_argument("--out", help="also write the result to this JSON file")
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    with on_ranks():
        require_outputs(arguments)
        options = collect(DistanceStudyOptions, arguments)
        result = measure_distances(tuple(arguments.files), options)
        result["provenance"] = measured(parameters(arguments))
        write_json(arguments, result)
    print(json.dumps(result, indent=2) if arguments.json else as_text(result))
