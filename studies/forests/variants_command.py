"""Train in other ways, with leaves of equal storage in all, and compare their errors."""

import argparse

from carillon.command_line.outputs import require_outputs
from carillon.parameters.command_line import collect
from forests.commands.training import add_training, add_workers, data_of
from forests.training.options import TrainingOptions
from forests.training.ranks import Ranks
from studies.base.command_results import add_outputs, publish
from studies.forests import training


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_training(parser)
    parser.add_argument("--only", action="append", metavar="NAME", help="may be repeated")
    add_workers(parser)
    add_outputs(parser)


def run(arguments: argparse.Namespace) -> None:
    """Train every variant and print their scores."""
    require_outputs(arguments, arguments.datasets)
    how = collect(TrainingOptions, arguments)
    names = arguments.only or tuple(training.VARIANTS)
    rows = training.variants(data_of(arguments, Ranks()), how, arguments.workers, names)
    publish(arguments, rows, training.as_text(rows), arguments.workers)
