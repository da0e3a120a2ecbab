"""Time the evaluation of forests: a block, a mesh, loading, over the size, and scikit-learn."""

from __future__ import annotations

import argparse

from carillon.arguments import number_between, whole_number
from forests.commands.results import add_outputs, publish, require_outputs
from forests.commands.table import MOST_BLOCKS
from forests.studies import benchmark


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("--model", help="forests to measure (default: the packaged ones)")
    parser.add_argument("--blocks", type=whole_number(1, MOST_BLOCKS), default=100_000)
    parser.add_argument("--largest", type=number_between(1e-3, 1e6), default=600.0, metavar="MB")
    add_outputs(parser)


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    require_outputs(arguments, *([arguments.model] if arguments.model else []))
    result = benchmark.benchmark(arguments.model, arguments.blocks, arguments.largest)
    text = benchmark.as_text(result)
    publish(arguments, benchmark.as_json(result), text, max(benchmark.THREADS))
