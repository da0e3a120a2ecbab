"""Train both forests on shards of training data, and write them to a file.

On several ranks the forests are the same: mpiexec -n RANKS python -m mpi4py -m carillon train ...
"""

import argparse

from carillon.command_line.progress import say
from carillon.files.paths import require_writable
from carillon.parameters.command_line import collect
from carillon.processes.ranks import world
from forests.commands.training import add_training, add_workers
from forests.model import save_model
from forests.training.dataset import Dataset, open_dataset
from forests.training.ranks import Ranks
from forests.training.structure import Tree
from forests.training.train import TrainingOptions, model_of, parameters_of, train_trees
from forests.training.tree_file import load_trees

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


def _opened(arguments: argparse.Namespace) -> tuple[TrainingOptions, Dataset, Grown | None]:
    require_writable(arguments.out, [*arguments.datasets, *(arguments.structure or [])])
    training = collect(TrainingOptions, arguments)
    dataset = open_dataset(arguments.datasets)
    if arguments.structure is None:
        return training, dataset, None
    return training, dataset, load_trees(arguments.structure, parameters_of(dataset, training))


def run(arguments: argparse.Namespace) -> None:
    """Train and write the model, together with the other ranks of the job if there are any."""
    ranks = Ranks(world())
    training, dataset, grown = ranks.agree(lambda: _opened(arguments))
    trained = train_trees(dataset, training, ranks, arguments.workers, grown=grown)
    if trained is None:
        return
    model = model_of(dataset, training, trained)
    save_model(arguments.out, model)
    facts = trained.facts
    scores = "".join(f", {name} {value:.4g}" for name, value in model.scores.items())
    say(
        f"{arguments.out}: {facts['training_rows']:,} rows; structure "
        f"{facts['structure_seconds']:.1f} s, leaves {facts['leaves_seconds']:.1f} s = "
        f"{facts['rows_per_second']:,.0f} rows/s{scores}"
    )
