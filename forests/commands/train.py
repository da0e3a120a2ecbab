"""Train both forests on training data, and write them to a file.

What is done is kept beside that file: the same command goes on where a killed one ended.
On several ranks the forests are the same: mpiexec -n RANKS python -m mpi4py -m carillon train ...
"""

import argparse

from carillon.command_line import exit_status
from carillon.command_line.progress import say
from carillon.files.paths import require_writable
from carillon.parameters.command_line import collect, reader
from carillon.parameters.quantities import Positive
from carillon.processes.ranks import world
from forests.commands.training import add_training, add_workers, data_of
from forests.training.dataset import Dataset
from forests.training.options import TrainingOptions, parameters_of
from forests.training.ranks import Ranks
from forests.training.train import Grown, write_forests
from forests.training.tree_file import load_trees

EXAMPLES = """examples:
  train shards/*.h5 --workers 2 --out forests.h5
  train --samples 1e6 --seed 1 --workers 2 --out forests.h5
  train shards/*.h5 --structure trees/*.h5 --out forests.h5
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_training(parser)
    parser.add_argument("--out", required=True, help="HDF5 file to write")
    parser.add_argument(
        "--structure", nargs="+", metavar="TREE", help="all trees, made by grow with equal options"
    )
    parser.add_argument(
        "--keep-minutes",
        type=reader(Positive),
        default=5.0,
        metavar="MINUTES",
        help="time between two times that what is known of the leaves is kept (default 5)",
    )
    add_workers(parser, "threads, of each rank")


def _opened(
    arguments: argparse.Namespace, ranks: Ranks
) -> tuple[TrainingOptions, Dataset, Grown | None]:
    require_writable(arguments.out, [*arguments.datasets, *(arguments.structure or [])])
    training, dataset = collect(TrainingOptions, arguments), data_of(arguments, ranks)
    if arguments.structure is None:
        return training, dataset, None
    return training, dataset, load_trees(arguments.structure, parameters_of(dataset, training))


def run(arguments: argparse.Namespace) -> int:
    """Train and write the model, together with the other ranks of the job if there are any."""
    ranks = Ranks(world())
    training, dataset, grown = ranks.agree(lambda: _opened(arguments, ranks))
    keep_seconds = 60.0 * arguments.keep_minutes
    try:
        model = write_forests(
            *(arguments.out, dataset, training, ranks, arguments.workers),
            grown=grown,
            keep_seconds=keep_seconds,
        )
    except KeyboardInterrupt:
        say(f"{arguments.out}: interrupted; the same command goes on from what was kept")
        return exit_status.EXIT_INTERRUPTED
    if model is None:
        return 0
    facts = model.provenance
    scores = "".join(f", {name} {value:.4g}" for name, value in model.scores.items())
    say(
        f"{arguments.out}: {facts['training_rows']:,} rows; structure "
        f"{facts['structure_seconds']:.1f} s, leaves {facts['leaves_seconds']:.1f} s = "
        f"{facts['rows_per_second']:,.0f} rows/s{scores}"
    )
    return 0
