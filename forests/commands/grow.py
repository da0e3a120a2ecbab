"""Grow one tree on shards of training data: its splits, without the answers of its leaves.

`forests train --structure` takes the trees that such jobs have grown.
"""

import argparse
import time

from carillon.command_line.progress import say
from carillon.errors import UserError
from carillon.files.paths import require_writable
from carillon.parameters.command_line import collect, reader
from carillon.parameters.quantities import Number
from forests.commands.training import add_training
from forests.training.dataset import open_dataset
from forests.training.train import TrainingOptions, grow_trees, parameters_of
from forests.training.tree_file import save_tree


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_training(parser)
    parser.add_argument("--out", required=True, help="HDF5 file to write")
    parser.add_argument("--tree", type=reader(Number), required=True, help="its number, from 0")


def run(arguments: argparse.Namespace) -> None:
    """Grow one tree and write it."""
    require_writable(arguments.out, arguments.datasets)
    training = collect(TrainingOptions, arguments)
    job = arguments.tree
    if job not in training.jobs:
        raise UserError(f"tree {job} of 2 x {training.trees}: expected 0 to {training.jobs[-1]}")
    dataset = open_dataset(arguments.datasets)
    begin = time.perf_counter()
    tree = grow_trees(dataset, training, training.jobs[job : job + 1])[job]
    seconds = time.perf_counter() - begin
    save_tree(arguments.out, tree, job, parameters_of(dataset, training), seconds)
    say(f"{arguments.out}: tree {job}, {tree.leaves:,} leaves, depth {tree.depth}")
