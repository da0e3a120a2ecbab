"""Time the evaluation of forests: a block, a mesh, loading, over the size, and scikit-learn."""

import argparse

from carillon.command_line.outputs import require_outputs
from carillon.parameters.command_line import add_options, collect
from studies.base.command_results import add_outputs, publish
from studies.forests import benchmark


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_options(parser, benchmark.ForestBenchmarkOptions)
    add_outputs(parser)


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    require_outputs(arguments, [arguments.forest] if arguments.forest else [])
    result = benchmark.benchmark(collect(benchmark.ForestBenchmarkOptions, arguments))
    publish(arguments, result, benchmark.as_text(result), max(benchmark.THREADS))
