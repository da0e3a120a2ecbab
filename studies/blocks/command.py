"""Compare every coarsening on random blocks: error, cost of a block, storage (Fig. 9)."""

import argparse

from carillon.command_line.outputs import require_outputs
from carillon.parameters.command_line import add_options, collect
from studies.base.command_results import add_outputs, publish
from studies.blocks import table
from studies.blocks.cases import CASES
from studies.blocks.methods import common_poisson, databases_of, load_models

EXAMPLES = """examples:
  table
  table --model forests.h5 --blocks 2000 --plot table.svg
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("--model", action="append", help="forests to compare, may be repeated")
    add_options(parser, table.TableOptions)
    parser.add_argument("--database", metavar="FILE", help="read databases, or build and write")
    parser.add_argument("--plot", metavar="FILE", help="error over cost, as .png, .svg or .pdf")
    add_outputs(parser)


def run(arguments: argparse.Namespace) -> None:
    """Work out the table and print it."""
    require_outputs(arguments, arguments.model or [])
    models = load_models(arguments.model)
    poisson = common_poisson(models)
    options = collect(table.TableOptions, arguments)
    databases = databases_of(CASES, poisson, arguments.database, options.materials)
    rows = table.table(models, options, databases)
    if arguments.plot:
        from studies.blocks.plot import plot  # matplotlib takes a while to load

        plot(rows, arguments.plot)
    publish(arguments, rows, table.as_text(rows), threads=1)
