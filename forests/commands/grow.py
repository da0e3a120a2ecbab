"""Grow one tree on training data: its splits, without the answers of its leaves.

`train --structure` takes the trees that such jobs have grown.  A tree that is too large for one
machine is grown on several: mpiexec -n RANKS python -m mpi4py -m carillon grow ...
"""

import argparse

from carillon.command_line.progress import say
from carillon.errors import UserError
from carillon.files.paths import require_writable
from carillon.parameters.command_line import collect, reader
from carillon.parameters.quantities import Number
from carillon.processes.memory import peak_memory
from carillon.processes.ranks import world
from forests.commands.training import add_training, add_workers, data_of
from forests.training.dataset import Dataset
from forests.training.growing import grow_trees
from forests.training.options import TrainingOptions, parameters_of
from forests.training.ranks import Ranks
from forests.training.spent import Stopwatch
from forests.training.tree_file import save_tree

EXAMPLES = """examples:
  grow shards/*.h5 --tree 0 --out trees/0.h5
  grow --samples 1.25e9 --seed 1 --structure-rows 100000000 --tree 0 --out trees/0.h5
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_training(parser)
    parser.add_argument("--out", required=True, help="HDF5 file to write")
    parser.add_argument("--tree", type=reader(Number), required=True, help="its number, from 0")
    add_workers(parser, "threads, of each rank")


def run(arguments: argparse.Namespace) -> None:
    """Grow one tree and write it, together with the other ranks of the job if there are any."""
    ranks = Ranks(world())
    training, dataset = ranks.agree(lambda: _opened(arguments, ranks))
    clock = Stopwatch()
    job = arguments.tree
    ((_, tree),) = grow_trees(dataset, training, [job], ranks, arguments.workers)
    spent, peak = clock.read(), max(ranks.in_order([peak_memory()]))
    if not ranks.first:
        return
    save_tree(arguments.out, tree, job, parameters_of(dataset, training), spent)
    say(
        f"{arguments.out}: tree {job}, {tree.leaves:,} leaves, depth {tree.depth}; "
        f"{spent.seconds:.1f} s, {spent.processor_seconds:.1f} s of processor time, peak memory "
        f"{peak / 1e6:,.0f} MB{' of a rank' if ranks.size > 1 else ''}"
    )


def _opened(arguments: argparse.Namespace, ranks: Ranks) -> tuple[TrainingOptions, Dataset]:
    require_writable(arguments.out, arguments.datasets)
    training = collect(TrainingOptions, arguments)
    if arguments.tree not in training.jobs:
        raise UserError(
            f"tree {arguments.tree} of 2 x {training.trees}: expected 0 to {training.jobs[-1]}"
        )
    return training, data_of(arguments, ranks)
