"""Command line: `python -m forests COMMAND`; `--help` lists the commands."""

from __future__ import annotations

import argparse
import json
import sys

from carillon import cli
from carillon.arguments import Parser, number_between, whole_number
from carillon.errors import UserError
from carillon.files import atomic_path, require_writable
from carillon.measurement import measured
from carillon.pictures import require_plottable
from dataset_gen.ranks import refuse, world
from forests import summary
from forests.comparison import table
from forests.comparison.cases import CASES
from forests.comparison.database import MATERIALS, MOST_MATERIALS
from forests.comparison.methods import common_poisson, databases_of, load_models
from forests.comparison.plot import plot
from forests.model import default_path
from forests.studies import benchmark
from forests.studies import training as studies
from forests.training import command
from forests.training.command import PROGRAM
from forests.training.dataset import open_dataset

MOST_BLOCKS = 1_000_000
"""Blocks that a table or a benchmark keeps in memory."""
HIDDEN = ("out", "json", "plot")
"""Arguments on which a result does not depend."""


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
    compare = commands.add_parser("table", help="error, cost and storage of every coarsening")
    compare.add_argument("--model", action="append", help="forests to compare, may be repeated")
    compare.add_argument(
        "--blocks", type=whole_number(1, MOST_BLOCKS), default=10_000, help="of each range"
    )
    compare.add_argument("--seed", type=whole_number(0), default=0)
    compare.add_argument(
        "--materials", type=whole_number(2, MOST_MATERIALS), default=MATERIALS, help="a database"
    )
    compare.add_argument("--database", metavar="FILE", help="read databases, or build and write")
    compare.add_argument("--plot", metavar="FILE", help="error over cost, as .png, .svg or .pdf")
    cost = commands.add_parser("benchmark", help="time of a block, of loading, over the size")
    cost.add_argument("--model", help="forests to measure (default: the packaged ones)")
    cost.add_argument("--blocks", type=whole_number(1, MOST_BLOCKS), default=100_000)
    cost.add_argument("--largest", type=number_between(1e-3, 1e6), default=600.0, metavar="MB")
    for measuring in (alternatives, curve, compare, cost):
        measuring.add_argument("--json", action="store_true")
        measuring.add_argument("--out", metavar="FILE", help="result and provenance, as JSON")
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


def _models(arguments: argparse.Namespace) -> list[str]:
    named = getattr(arguments, "model", None) or []
    return [named] if isinstance(named, str) else named


def _save(result: object, arguments: argparse.Namespace) -> None:
    """Write a result with its provenance to the file that `--out` names."""
    threads = {"table": 1, "benchmark": max(benchmark.THREADS)}.get(arguments.command)
    parameters = {key: value for key, value in vars(arguments).items() if key not in HIDDEN}
    origin = measured(parameters, threads=threads or arguments.workers)
    with atomic_path(arguments.out) as temporary:
        temporary.write_text(json.dumps({"result": result, "provenance": origin}, indent=1))


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


def _found(arguments: argparse.Namespace) -> tuple[object, str]:
    """Result of a command as plain values and as text."""
    match arguments.command:
        case "table":
            rows = _table(arguments)
            return rows, table.as_text(rows)
        case "benchmark":
            measurement = benchmark.benchmark(arguments.model, arguments.blocks, arguments.largest)
            return benchmark.as_json(measurement), benchmark.as_text(measurement)
        case "variants" | "curve":
            studied = _studied(arguments)
            return studied, studies.as_text(studied)
        case _:
            found = summary.describe(default_path() if arguments.file is None else arguments.file)
            return found, summary.as_text(found)


def main(argv: list[str] | None = None) -> int:
    """Run one command."""
    arguments = _arguments(argv)
    if arguments is None:
        return cli.EXIT_BAD_INPUT
    match arguments.command:
        case "grow":
            return command.run_grow(arguments)
        case "train":
            return command.run_train(arguments)
    out = getattr(arguments, "out", None)
    if out is not None:
        require_writable(out, [*(getattr(arguments, "datasets", [])), *_models(arguments)])
    result, text = _found(arguments)
    if out is not None:
        _save(result, arguments)
    print(json.dumps(result, indent=2) if arguments.json else text)
    return 0


if __name__ == "__main__":
    sys.exit(cli.run(PROGRAM, main))
