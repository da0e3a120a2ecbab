"""Rate voxels, finite cells and tetrahedra by frequencies that no mesh made, over size and time."""

import argparse
import json

from carillon.parameters.command_line import add_options, collect
from carillon.records.measurement import measured
from solver.commands.running import on_ranks, parameters, require_outputs, write_json
from studies.accuracy.measure import AccuracyOptions, as_text, measure_accuracy

EXAMPLES = """example:
  accuracy --solids plate,sphere --levels 3 --out accuracy.json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_options(parser, AccuracyOptions)
    parser.add_argument("--out", help="also write the result to this JSON file")
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    with on_ranks():
        require_outputs(arguments)
        result = measure_accuracy(collect(AccuracyOptions, arguments))
        result["provenance"] = measured(parameters(arguments))
        write_json(arguments, result)
    print(json.dumps(result, indent=2) if arguments.json else as_text(result))
