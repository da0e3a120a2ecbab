"""Rate the fit objectives, and forests, by the spectra of one solid that they coarsen."""

import argparse
import json
from typing import Any

from carillon.errors import UserError
from carillon.parameters.command_line import collect, reader
from carillon.parameters.quantities import NumberOfModes
from carillon.processes import extras
from carillon.records.provenance import record
from dataset_gen.objectives import OBJECTIVES, require_objective
from solver.analysis.problem import ProblemOptions
from solver.commands.running import (
    COMPOSED,
    add_voxels,
    on_ranks,
    parameters,
    require_outputs,
    write_json,
)
from studies.objectives.measure import rate_objectives

EXAMPLES = """example:
  objectives builtin:bell --resolution 24 --material noise --modes 60
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_voxels(parser, "objective", *COMPOSED)
    parser.add_argument(
        "--modes", type=reader(NumberOfModes), default=256, help="rigid included (default 256)"
    )
    parser.add_argument(
        "--objectives",
        type=_objective_names,
        default=list(OBJECTIVES),
        help="separated by commas (default: all)",
    )
    parser.add_argument("--out", help="also write the result to this JSON file")
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(arguments: argparse.Namespace) -> None:
    """Solve with every coarsening and print the errors."""
    with on_ranks() as comm:
        extras.require(extras.SLEPC, "the study of objectives")
        require_outputs(arguments, comm)
        described = collect(ProblemOptions, arguments)
        ratings = rate_objectives(described, arguments.modes, arguments.objectives, comm)
        ratings["provenance"] = record(parameters(arguments))
        write_json(arguments, ratings, comm)
        if comm.rank:
            return
    if arguments.json:
        print(json.dumps(ratings, indent=2))
    else:
        _print_errors(ratings)


def _objective_names(text: str) -> list[str]:
    """Argument type: names of objectives, separated by commas."""
    names = list(dict.fromkeys(text.split(",")))
    try:
        for name in names:
            require_objective(name)
    except UserError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    return names


def _print_errors(ratings: dict[str, Any]) -> None:
    print(
        f"{ratings['n_dofs']:,} unknowns coarsened to {ratings['coarse_n_dofs']:,}; frequency "
        "errors against SLEPc on the fine mesh"
    )
    last = {part: max(row[part]["last"] for row in ratings["rows"]) for part in ("audible", "all")}
    parts = ["audible", "all"] if last["all"] > last["audible"] else ["all"]
    spans = [f"modes 7 to {last[part]}" for part in parts]
    heads = "     rms     mean    worst  mode" * len(parts)
    print(f"{'':<14s}" + "".join(f"{span:>32s}" for span in spans))
    print(f"{'':<14s}{heads}      fit    modes")
    for row in ratings["rows"]:
        errors = "".join(_errors(row[part]) for part in parts)
        seconds = "".join(f"{row[f'{step}_seconds']:7.2f} s" for step in ("fit", "solve"))
        print(f"{row['coarsening']:<14s}{errors}{seconds}")


def _errors(errors: dict[str, Any]) -> str:
    percent = f"{errors['rms']:8.1%} {errors['mean']:+8.1%} {errors['worst']:+8.1%}"
    return f"{percent} {errors['worst_mode']:5d}"
