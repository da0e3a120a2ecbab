"""Time the fits of every objective on one core, and compare them with what the core can do."""

from __future__ import annotations

import argparse
import json

from carillon.options import add_options, collect
from dataset_gen import benchmark


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_options(parser, benchmark.FitBenchmarkOptions)
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    result = benchmark.benchmark(collect(benchmark.FitBenchmarkOptions, arguments))
    print(json.dumps(result, indent=2) if arguments.json else benchmark.as_text(result))
