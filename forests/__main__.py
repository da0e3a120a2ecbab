"""Command line: `python -m forests COMMAND`; `--help` lists the commands."""

from __future__ import annotations

import argparse
import json
import sys

from carillon import cli
from carillon.arguments import Parser, positive_number, whole_number
from carillon.errors import UserError
from carillon.files import require_writable
from dataset_gen.ranks import refuse, world
from forests import benchmark, summary
from forests.comparison import table
from forests.comparison.cases import CASES
from forests.comparison.database import MATERIALS
from forests.comparison.methods import common_poisson, databases_of, load_models
from forests.comparison.plot import plot, require_plottable
from forests.model import default_path
from forests.training import command, studies
from forests.training.command import PROGRAM
from forests.training.dataset import open_dataset


def _parser() -> Parser:
    parser = Parser(prog="forests", description="Regression forests that coarsen 2x2x2 blocks.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    command.add_parsers(commands)
    alternatives = commands.add_parser("variants", help="other ways to train, of equal storage")
    command.add_training(alternatives)
    alternatives.add_argument("--only", action="append", metavar="NAME", help="may be repeated")
    curve = commands.add_parser("curve", help="error over the rows trained on")
    command.add_training(curve)
    curve.add_argument("--rows", default="1e5,3e5,1e6,3e6,1e7", help="(default %(default)s)")
    curve.add_argument("--plot", metavar="FILE", help="the curve, as .png, .svg or .pdf")
    for study in (alternatives, curve):
        command.add_workers(study)
        study.add_argument("--json", action="store_true")
    compare = commands.add_parser("table", help="error, cost and storage of every coarsening")
    compare.add_argument("--model", action="append", help="forests to compare, may be repeated")
    compare.add_argument("--blocks", type=whole_number(1), default=10_000, help="of each range")
    compare.add_argument("--seed", type=whole_number(0), default=0)
    compare.add_argument("--materials", type=whole_number(2), default=MATERIALS, help="a database")
    compare.add_argument("--database", metavar="FILE", help="read databases, or build and write")
    compare.add_argument("--plot", metavar="FILE", help="error over cost, as .png, .svg or .pdf")
    compare.add_argument("--json", action="store_true")
    cost = commands.add_parser("benchmark", help="time of a block, of loading, over the size")
    cost.add_argument("--model", help="forests to measure (default: the packaged ones)")
    cost.add_argument("--blocks", type=whole_number(1), default=100_000)
    cost.add_argument("--largest", type=positive_number, default=600.0, metavar="MB")
    cost.add_argument("--json", action="store_true")
    show = commands.add_parser("inspect", help="validate and summarise a model")
    show.add_argument("file", nargs="?", help="by default that of the forests of Carillon")
    show.add_argument("--json", action="store_true")
    return parser


def _studied(arguments: argparse.Namespace) -> list[studies.Row]:
    training = command.training_of(arguments)
    dataset = open_dataset(arguments.datasets)
    if arguments.command == "variants":
        names = arguments.only or tuple(studies.VARIANTS)
        return studies.variants(dataset, training, arguments.workers, names)
    if arguments.plot:
        require_writable(require_plottable(arguments.plot))
    counts = studies.require_counts(arguments.rows)
    rows = studies.learning_curve(dataset, training, counts, arguments.workers)
    if arguments.plot:
        studies.error_over_rows(rows, arguments.plot)
    return rows


def _table(arguments: argparse.Namespace) -> list[table.Row]:
    if arguments.plot:
        require_writable(require_plottable(arguments.plot))
    models = load_models(arguments.model)
    poisson = common_poisson(models)
    databases = databases_of(CASES, poisson, arguments.database, arguments.materials)
    rows = table.table(models, arguments.blocks, arguments.seed, databases=databases)
    if arguments.plot:
        plot(rows, arguments.plot)
    return rows


def _arguments(argv: list[str] | None) -> argparse.Namespace | None:
    """The command line; None if it is wrong and this is one of several ranks, which has said so."""
    comm = world()
    try:
        arguments = _parser().parse_args(argv)
        if comm is not None and arguments.command != "train":
            raise UserError(
                f"{arguments.command} on {comm.size} ranks: only train runs on several, start it "
                "as one process"
            )
    except UserError as error:
        if comm is None:
            raise
        refuse(comm, PROGRAM, error)
        return None
    return arguments


def main(argv: list[str] | None = None) -> int:
    """Run one command."""
    arguments = _arguments(argv)
    if arguments is None:
        return cli.EXIT_BAD_INPUT
    result: object
    match arguments.command:
        case "grow":
            return command.run_grow(arguments)
        case "train":
            return command.run_train(arguments)
        case "table":
            result = rows = _table(arguments)
            text = table.as_text(rows)
        case "benchmark":
            measured = benchmark.benchmark(arguments.model, arguments.blocks, arguments.largest)
            result, text = benchmark.as_json(measured), benchmark.as_text(measured)
        case "variants" | "curve":
            result = studied = _studied(arguments)
            text = studies.as_text(studied)
        case _:
            result = found = summary.describe(arguments.file or default_path())
            text = summary.as_text(found)
    print(json.dumps(result, indent=2) if arguments.json else text)
    return 0


if __name__ == "__main__":
    sys.exit(cli.run(PROGRAM, main))
