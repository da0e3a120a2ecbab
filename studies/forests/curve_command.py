"""Train on more and more rows, and follow the error."""

import argparse
import os
from tempfile import TemporaryDirectory

from carillon.command_line.outputs import require_outputs
from carillon.errors import UserError
from carillon.files.paths import cause
from carillon.parameters.command_line import collect
from forests.commands.training import add_training, add_workers, data_of
from forests.training.options import TrainingOptions
from forests.training.ranks import Ranks
from studies.base.command_results import add_outputs, publish
from studies.forests import training


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_training(parser)
    parser.add_argument("--rows", default="1e5,3e5,1e6,3e6,1e7", help="(default %(default)s)")
    parser.add_argument(
        "--folder",
        help="where the forests are kept: a later call takes them from there, or goes on",
    )
    parser.add_argument("--plot", metavar="FILE", help="the curve, as .png, .svg or .pdf")
    add_workers(parser)
    add_outputs(parser)


def _make(folder: str) -> None:
    try:
        os.makedirs(folder, exist_ok=True)
    except OSError as error:
        raise UserError(
            f"{folder}: cannot be made ({cause(error)}), expected a folder for forests"
        ) from None


def run(arguments: argparse.Namespace) -> None:
    """Train on each number of rows and print the scores."""
    require_outputs(arguments, arguments.datasets)
    how = collect(TrainingOptions, arguments)
    dataset = data_of(arguments, Ranks())
    counts = training.require_counts(arguments.rows)
    with TemporaryDirectory() as temporary:
        folder = arguments.folder or temporary
        _make(folder)
        rows = training.learning_curve(dataset, how, counts, folder, arguments.workers)
    if arguments.plot:
        from studies.forests.plots import save_curve  # matplotlib takes a while to load

        save_curve(rows, arguments.plot)
    publish(arguments, rows, training.as_text(rows), arguments.workers)
