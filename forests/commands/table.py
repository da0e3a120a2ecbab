"""Compare every coarsening on random blocks: error, cost of a block, storage (Fig. 9)."""

from __future__ import annotations

import argparse

from carillon.arguments import whole_number
from forests.commands.results import add_outputs, publish, require_outputs
from forests.comparison import table
from forests.comparison.cases import CASES
from forests.comparison.database import MATERIALS, MOST_MATERIALS
from forests.comparison.methods import common_poisson, databases_of, load_models
from forests.comparison.plot import plot

MOST_BLOCKS = 1_000_000
"""Blocks that a table or a benchmark keeps in memory."""
EXAMPLES = """examples:
  table
  table --model forests.h5 --blocks 2000 --plot table.svg
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("--model", action="append", help="forests to compare, may be repeated")
    parser.add_argument(
        "--blocks", type=whole_number(1, MOST_BLOCKS), default=10_000, help="of each range"
    )
    parser.add_argument("--seed", type=whole_number(0), default=0, help="(default 0)")
    parser.add_argument(
        "--materials", type=whole_number(2, MOST_MATERIALS), default=MATERIALS, help="a database"
    )
    parser.add_argument("--database", metavar="FILE", help="read databases, or build and write")
    parser.add_argument("--plot", metavar="FILE", help="error over cost, as .png, .svg or .pdf")
    add_outputs(parser)


def run(arguments: argparse.Namespace) -> None:
    """Work out the table and print it."""
    require_outputs(arguments, *(arguments.model or []))
    models = load_models(arguments.model)
    poisson = common_poisson(models)
    databases = databases_of(CASES, poisson, arguments.database, arguments.materials)
    rows = table.table(models, arguments.blocks, arguments.seed, databases=databases)
    if arguments.plot:
        plot(rows, arguments.plot)
    publish(arguments, rows, table.as_text(rows), threads=1)
