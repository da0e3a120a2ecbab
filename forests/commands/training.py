"""The arguments of all commands that train."""

import argparse

from carillon.parameters.command_line import add_options, reader
from carillon.parameters.quantities import Workers
from forests.training.train import TrainingOptions


def add_training(parser: argparse.ArgumentParser) -> None:
    """Add the shards and the parameters of a training to a command."""
    parser.add_argument("datasets", nargs="+", metavar="DATASET", help="shards of dataset_gen")
    add_options(parser, TrainingOptions)


def add_workers(parser: argparse.ArgumentParser, meaning: str = "threads") -> None:
    """Add the number of threads of a training to a command."""
    parser.add_argument("--workers", type=reader(Workers), default=1, help=meaning)
