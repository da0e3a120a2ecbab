"""Time every way to a spectrum on one solid, in alternating runs (Fig. 11)."""

import argparse
import json

from carillon.parameters.command_line import add_options, collect
from carillon.records.measurement import measured
from solver.analysis.problem import ProblemOptions
from solver.commands.running import (
    COMPOSED,
    add_solid,
    on_ranks,
    parameters,
    require_outputs,
    write_json,
)
from studies.benchmark.options import BenchmarkOptions
from studies.benchmark.row import benchmark_row, row_lines

EXAMPLES = """examples:
  benchmark builtin:bell --resolution 24
  benchmark bunny.obj --resolution 32 --no-arpack --tune --out row.json
  benchmark builtin:bell --resolution 16 --discretisation finite-cell
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_solid(parser, "coarsen", "objective", *COMPOSED)
    add_options(parser, BenchmarkOptions)
    parser.add_argument("--out", help="also write the row to this JSON file")
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(arguments: argparse.Namespace) -> None:
    """Measure and print a row."""
    with on_ranks() as comm:
        require_outputs(arguments, comm)
        described = collect(ProblemOptions, arguments)
        row = benchmark_row(described, collect(BenchmarkOptions, arguments), comm)
        row["provenance"] = measured(parameters(arguments), comm.size)
        write_json(arguments, row, comm)
        if comm.rank == 0:
            print(json.dumps(row, indent=2) if arguments.json else "\n".join(row_lines(row)))
