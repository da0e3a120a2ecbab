"""Compare ways to a spectrum of one solid: voxels, coarse elements of them, and finite cells."""

import argparse
import json
from typing import Annotated, Any

from carillon.fem.model import RIGID_MODES
from carillon.parameters.command_line import collect, reader
from carillon.parameters.quantities import between
from carillon.records.measurement import measured
from solver.analysis.problem import ProblemOptions
from solver.commands.running import (
    COMPOSED,
    WALL,
    add_solid,
    on_ranks,
    parameters,
    require_outputs,
    write_json,
)
from studies.discretisation.case import rate_discretisations

EXAMPLES = """example:
  discretisation builtin:bell --resolution 20 --material noise --out case.json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_solid(parser, "coarsen", "objective", "discretisation", "fill", "lumped", *WALL, *COMPOSED)
    parser.add_argument(
        "--modes",
        type=reader(Annotated[int, between(RIGID_MODES + 1, 1000)]),
        default=36,
        help="rigid included (default 36)",
    )
    parser.add_argument(
        "--runs",
        type=reader(Annotated[int, between(1, 1000)]),
        default=3,
        help="rounds, in each of which every way runs once (default 3)",
    )
    parser.add_argument("--out", help="also write the result to this JSON file")
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(arguments: argparse.Namespace) -> None:
    """Solve by every way, compare, write, and print the errors."""
    with on_ranks():
        require_outputs(arguments)
        case = rate_discretisations(
            collect(ProblemOptions, arguments), arguments.modes, arguments.runs
        )
        case["provenance"] = measured(parameters(arguments))
        write_json(arguments, case)
    if arguments.json:
        print(json.dumps(case, indent=2))
    else:
        _print_errors(case)


def _print_errors(case: dict[str, Any]) -> None:
    truth = case["truth"]
    print(
        f"frequency errors of modes {RIGID_MODES + 1} to {case['modes']} against the solid, which "
        f"finite cells of {truth['n_dofs']:,} unknowns tell to {truth['doubt_rms']:.1%} (worst "
        f"{truth['doubt_worst']:.1%}), and against its voxels"
    )
    print(f"{'':<20s}{'unknowns':>10s}{'seconds':>9s}{'solid':>18s}{'voxels':>18s}")
    print(f"{'':<39s}{'     rms     worst' * 2}")
    for name, way in case["ways"].items():
        errors = "".join(
            f"{each['rms']:8.1%} {each['worst']:+9.1%}" for each in way["against"].values()
        )
        print(f"{name:<20s}{way['n_dofs']:10,}{way['seconds']:9.2f}{errors}")
