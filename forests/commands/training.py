"""The arguments of all commands that train."""

from __future__ import annotations

import argparse
from dataclasses import replace

from carillon.arguments import LARGEST, number_between, number_of_workers, whole_number
from forests.layout import MOST_LEAVES
from forests.scaling import TRANSFORMS
from forests.training.structure import GROWERS
from forests.training.train import TrainingOptions


def add_training(parser: argparse.ArgumentParser) -> None:
    """Add the shards and the parameters of a training to a command."""
    default = TrainingOptions()
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


def add_workers(parser: argparse.ArgumentParser, meaning: str = "threads") -> None:
    """Add the number of threads of a training to a command."""
    parser.add_argument("--workers", type=number_of_workers, default=1, help=meaning)


def training_of(arguments: argparse.Namespace) -> TrainingOptions:
    """The parameters that `add_training` has read."""
    names = [name for name in vars(TrainingOptions()) if hasattr(arguments, name)]
    training = replace(TrainingOptions(), **{name: getattr(arguments, name) for name in names})
    training.validate()
    return training
