"""The commands `grow` and `train`, in one process or on several MPI ranks."""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from typing import Any

from carillon.arguments import (
    LARGEST,
    Parser,
    number_between,
    number_of_workers,
    whole_number,
)
from carillon.cli import EXIT_BAD_INPUT
from carillon.errors import UserError
from carillon.files import require_writable
from carillon.progress import say
from dataset_gen.ranks import world
from forests.layout import MOST_LEAVES
from forests.model import save_model
from forests.scaling import TRANSFORMS
from forests.training.dataset import Dataset, open_dataset
from forests.training.ranks import Ranks
from forests.training.structure import GROWERS, Tree
from forests.training.train import Training, grow_trees, model_of, parameters_of, train_trees
from forests.training.tree_file import load_trees, save_tree

PROGRAM = "forests"


def add_parsers(commands: Any) -> None:
    """Add both commands to the subparsers of `python -m forests`."""
    grow = commands.add_parser("grow", help="grow one tree, for a job of its own")
    add_training(grow)
    grow.add_argument("--out", required=True, help="HDF5 file to write")
    grow.add_argument("--tree", type=whole_number(0), required=True, help="its number, from 0")
    learn = commands.add_parser("train", help="train on shards, write the model")
    add_training(learn)
    learn.add_argument("--out", required=True, help="HDF5 file to write")
    learn.add_argument(
        "--structure", nargs="+", metavar="TREE", help="all trees, made by grow with equal options"
    )
    add_workers(learn, "threads, of each rank")


def add_training(parser: Parser) -> None:
    """Add the shards and the parameters of a training to a command."""
    default = Training()
    parser.add_argument("datasets", nargs="+", metavar="DATASET", help="shards of dataset_gen")
    wholes = {
        "trees": (1000, "of each of the two forests"),
        "depth": (1000, "of a tree, at most"),
        "max-leaves": (MOST_LEAVES, "of a tree, at most; 56 bytes each"),
        "min-leaf": (LARGEST, "rows of the subset that a leaf needs"),
        "structure-rows": (LARGEST, "rows of the subset that splits are chosen from"),
    }
    for name, (most, meaning) in wholes.items():
        parser.add_argument(
            f"--{name}",
            type=whole_number(1, most),
            default=getattr(default, name.replace("-", "_")),
            help=f"{meaning} (default %(default)s)",
        )
    for name, meaning in (
        ("prior", "rows that the surroundings of a leaf count for in it"),
        ("uniform-weight", "weight of blocks of one material"),
    ):
        parser.add_argument(
            f"--{name}",
            type=number_between(1e-9, 1e9),
            default=getattr(default, name.replace("-", "_")),
            help=f"{meaning} (default %(default)s)",
        )
    parser.add_argument("--transform", choices=TRANSFORMS, default=default.transform)
    parser.add_argument("--grower", choices=tuple(GROWERS), default=default.grower)
    parser.add_argument("--seed", type=whole_number(0), default=default.seed)


def add_workers(parser: Parser, meaning: str = "threads") -> None:
    """Add the number of threads of a training to a command."""
    parser.add_argument("--workers", type=number_of_workers, default=1, help=meaning)


def training_of(arguments: argparse.Namespace) -> Training:
    """The parameters that `add_training` has read."""
    names = [name for name in vars(Training()) if hasattr(arguments, name)]
    training = replace(Training(), **{name: getattr(arguments, name) for name in names})
    training.validate()
    return training


def run_grow(arguments: argparse.Namespace) -> int:
    """Grow one tree and write it."""
    require_writable(arguments.out, arguments.datasets)
    training = training_of(arguments)
    job = arguments.tree
    if job not in training.jobs:
        raise UserError(f"tree {job} of 2 x {training.trees}: expected 0 to {training.jobs[-1]}")
    dataset = open_dataset(arguments.datasets)
    begin = time.perf_counter()
    tree = grow_trees(dataset, training, training.jobs[job : job + 1])[job]
    seconds = time.perf_counter() - begin
    save_tree(arguments.out, tree, job, parameters_of(dataset, training), seconds)
    say(f"{arguments.out}: tree {job}, {tree.leaves:,} leaves, depth {tree.depth}")
    return 0


Grown = tuple[dict[int, Tree], float]


def _opened(arguments: argparse.Namespace) -> tuple[Training, Dataset, Grown | None]:
    require_writable(arguments.out, [*arguments.datasets, *(arguments.structure or [])])
    training = training_of(arguments)
    dataset = open_dataset(arguments.datasets)
    if arguments.structure is None:
        return training, dataset, None
    return training, dataset, load_trees(arguments.structure, parameters_of(dataset, training))


def run_train(arguments: argparse.Namespace) -> int:
    """Train and write the model, together with the other ranks of the job if there are any."""
    comm = world()
    ranks = Ranks(comm)
    opened = ranks.agree(PROGRAM, lambda: _opened(arguments))
    if opened is None:
        return EXIT_BAD_INPUT
    try:
        _train(arguments, ranks, *opened)
    except BaseException as error:
        if comm is None:
            raise
        ranks.end_all(PROGRAM, error)
    return 0


def _train(
    arguments: argparse.Namespace,
    ranks: Ranks,
    training: Training,
    dataset: Dataset,
    grown: Grown | None,
) -> None:
    trained = train_trees(dataset, training, ranks, arguments.workers, grown=grown)
    if trained is None:
        return
    model = model_of(dataset, training, trained)
    save_model(arguments.out, model)
    told = trained.facts
    scores = "".join(f", {name} {value:.4g}" for name, value in model.scores.items())
    say(
        f"{arguments.out}: {told['training_rows']:,} rows; structure "
        f"{told['structure_seconds']:.1f} s, leaves {told['leaves_seconds']:.1f} s = "
        f"{told['rows_per_second']:,.0f} rows/s{scores}"
    )
