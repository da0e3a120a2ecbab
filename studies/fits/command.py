"""Time the fits of every objective on one core, and compare them with what the core can do."""

import argparse
import json

from carillon.parameters.command_line import add_options, collect
from studies.fits import measure


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_options(parser, measure.FitBenchmarkOptions)
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    result = measure.benchmark(collect(measure.FitBenchmarkOptions, arguments))
    print(json.dumps(result, indent=2) if arguments.json else measure.as_text(result))
