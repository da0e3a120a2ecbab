"""The arguments of all commands that train."""

import argparse

from carillon.parameters.command_line import add_options, collect, reader
from carillon.parameters.quantities import Workers
from forests.training.dataset import Dataset
from forests.training.made import SampleOptions, training_data
from forests.training.options import TrainingOptions
from forests.training.ranks import Ranks


def add_training(parser: argparse.ArgumentParser) -> None:
    """Add the training data and the parameters of a training to a command."""
    parser.add_argument("datasets", nargs="*", metavar="DATASET", help="shards of dataset_gen")
    parser.add_argument(
        "--checked",
        action="store_true",
        help="whether all bytes of the shards have been checked since they were written (inspect)",
    )
    add_options(parser.add_argument_group("samples without shards"), SampleOptions)
    add_options(parser.add_argument_group("training"), TrainingOptions)


def add_workers(parser: argparse.ArgumentParser, meaning: str = "threads") -> None:
    """Add the number of threads of a training to a command."""
    parser.add_argument("--workers", type=reader(Workers), default=1, help=meaning)


def data_of(arguments: argparse.Namespace, ranks: Ranks) -> Dataset:
    """The training data that a command names: shards, each checked by one rank, or samples.

    Raises UserError if there are none, or they cannot be used.
    """
    own = slice(0, 0) if arguments.checked else slice(ranks.rank, None, ranks.size)
    made = collect(SampleOptions, arguments)
    return training_data(arguments.datasets, made, arguments.seed, own)
