"""Command line: `python -m forests train | table | inspect`."""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import replace

from carillon import cli
from carillon.arguments import Parser, positive_number, whole_number
from carillon.files import require_writable
from carillon.progress import say
from dataset_gen.shards import read_shards
from forests import summary, table
from forests.cases import CASES
from forests.database import MATERIALS
from forests.methods import common_poisson, databases_of, load_models
from forests.model import save_model
from forests.scaling import TRANSFORMS
from forests.structure import GROWERS
from forests.table_plot import plot, require_plottable
from forests.train import Training, parameters_of, train


def _parser() -> Parser:
    default = Training()
    parser = Parser(prog="forests", description="Regression forests that coarsen 2x2x2 blocks.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    learn = commands.add_parser("train", help="train on shards, write the model")
    learn.add_argument("datasets", nargs="+", metavar="DATASET", help="shards of dataset_gen")
    learn.add_argument("--out", required=True, help="HDF5 file to write")
    learn.add_argument("--trees", type=whole_number(1), default=default.trees)
    learn.add_argument("--depth", type=whole_number(1), default=default.depth)
    learn.add_argument("--min-leaf", type=whole_number(1), default=default.min_leaf)
    learn.add_argument("--structure-rows", type=whole_number(1), default=default.structure_rows)
    learn.add_argument("--prior", type=positive_number, default=default.prior)
    learn.add_argument("--uniform-weight", type=positive_number, default=default.uniform_weight)
    learn.add_argument("--transform", choices=TRANSFORMS, default=default.transform)
    learn.add_argument("--grower", choices=tuple(GROWERS), default=default.grower)
    learn.add_argument("--seed", type=whole_number(0), default=default.seed)
    learn.add_argument("--workers", type=whole_number(1), default=1, help="threads")
    compare = commands.add_parser("table", help="error, cost and storage of every coarsening")
    compare.add_argument("--model", action="append", help="forests to compare, may be repeated")
    compare.add_argument("--blocks", type=whole_number(1), default=10_000, help="of each range")
    compare.add_argument("--seed", type=whole_number(0), default=0)
    compare.add_argument("--materials", type=whole_number(2), default=MATERIALS, help="a database")
    compare.add_argument("--database", metavar="FILE", help="read databases, or build and write")
    compare.add_argument("--plot", metavar="FILE", help="error over cost, as .png, .svg or .pdf")
    compare.add_argument("--json", action="store_true")
    show = commands.add_parser("inspect", help="validate and summarise a model")
    show.add_argument("file")
    show.add_argument("--json", action="store_true")
    return parser


def _train(arguments: argparse.Namespace) -> None:
    require_writable(arguments.out)
    names = [name for name in vars(Training()) if hasattr(arguments, name)]
    training = replace(Training(), **{name: getattr(arguments, name) for name in names})
    shards = read_shards(arguments.datasets)
    model = train(shards, training, workers=arguments.workers)
    save_model(arguments.out, model, parameters_of(shards, training))
    scores = "".join(f", {name} {value:.4f}" for name, value in model.scores.items())
    say(f"{arguments.out}: {len(model.forests.low):,} leaves{scores}")


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


def main(argv: list[str] | None = None) -> None:
    """Run one command."""
    arguments = _parser().parse_args(argv)
    if arguments.command == "train":
        _train(arguments)
        return
    result: object
    if arguments.command == "table":
        result = rows = _table(arguments)
        text = table.as_text(rows)
    else:
        result = found = summary.describe(arguments.file)
        text = summary.as_text(found)
    print(json.dumps(result, indent=2) if arguments.json else text)


if __name__ == "__main__":
    sys.exit(cli.run("forests", main))
