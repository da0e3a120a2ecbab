"""Train both forests on shards of training data, and write them to a file.

On several ranks the forests are the same: mpiexec -n RANKS python -m mpi4py -m forests train ...
"""

from __future__ import annotations

import argparse

from carillon.cli import EXIT_BAD_INPUT
from carillon.files import require_writable
from carillon.progress import say
from carillon.ranks import world
from forests.commands.training import add_training, add_workers, training_of
from forests.model import save_model
from forests.training.dataset import Dataset, open_dataset
from forests.training.ranks import Ranks
from forests.training.structure import Tree
from forests.training.train import Training, model_of, parameters_of, train_trees
from forests.training.tree_file import load_trees

PROGRAM = "forests train"
EXAMPLES = """examples:
  train shards/*.h5 --workers 2 --out forests.h5
  train shards/*.h5 --structure trees/*.h5 --out forests.h5
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_training(parser)
    parser.add_argument("--out", required=True, help="HDF5 file to write")
    parser.add_argument(
        "--structure", nargs="+", metavar="TREE", help="all trees, made by grow with equal options"
    )
    add_workers(parser, "threads, of each rank")


Grown = tuple[dict[int, Tree], float]


def _opened(arguments: argparse.Namespace) -> tuple[Training, Dataset, Grown | None]:
    require_writable(arguments.out, [*arguments.datasets, *(arguments.structure or [])])
    training = training_of(arguments)
    dataset = open_dataset(arguments.datasets)
    if arguments.structure is None:
        return training, dataset, None
    return training, dataset, load_trees(arguments.structure, parameters_of(dataset, training))


def run(arguments: argparse.Namespace) -> int:
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
