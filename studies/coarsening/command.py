"""Rate a coarse model mode by mode: true and expected errors, and the elements to blame."""

import argparse
import json
from pathlib import Path
from typing import Annotated, Any

from carillon.errors import UserError
from carillon.fem.model import RIGID_MODES
from carillon.parameters.command_line import collect, reader
from carillon.parameters.quantities import NumberOfModes, Positive, between
from carillon.processes import extras
from carillon.records.measurement import measured
from solver.analysis.problem import ProblemOptions
from solver.coarsening.choice import METHODS
from solver.coarsening.forest import FOREST
from solver.commands.running import add_voxels, on_ranks, parameters, require_outputs, write_json
from solver.refinement.errors import ALLOWED_ERROR, LAST
from studies.coarsening.case import PICTURES, rate_coarsening
from studies.coarsening.picture_file import write_pictures

EXAMPLES = """example:
  coarsening builtin:dumbbell --resolution 24 --material noise --out case.json
"""


SHOWN = ("by_index", "recognised", "expected")
"""Errors that are printed."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_voxels(parser)
    parser.add_argument(
        "--coarsen",
        choices=[name for name in METHODS if name != "none"],
        default=FOREST,
        help=f"coarsening of the blocks (default {FOREST})",
    )
    parser.add_argument(
        "--refine-to",
        type=reader(Positive),
        default=ALLOWED_ERROR,
        metavar="ERROR",
        help="expected error of the frequencies down to which blocks stay fine in the second "
        f"model: its root mean square, and a third of the worst (default {ALLOWED_ERROR:g})",
    )
    parser.add_argument(
        "--modes",
        type=reader(Annotated[int, between(RIGID_MODES + 1, LAST)]),
        default=LAST,
        help=f"rigid included (default {LAST}, the most)",
    )
    parser.add_argument(
        "--timed-modes",
        type=reader(NumberOfModes),
        help="modes computed where the coarse model is weighed against the fine one and both are "
        "timed (default: --modes)",
    )
    parser.add_argument("--out", help="also write the result to this JSON file")
    parser.add_argument(
        "--pictures",
        metavar="FILE",
        help=f"write up to {PICTURES} modes that the plain model gets wrong to this file (HDF5)",
    )
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(arguments: argparse.Namespace) -> None:
    """Solve, compare, write, and print the errors."""
    with on_ranks():
        extras.require(extras.SLEPC, "the study of coarsening")
        require_outputs(arguments)
        names = [arguments.out, arguments.pictures]
        if None not in names and len({Path(name).resolve() for name in names}) == 1:
            raise UserError(f"{arguments.out}: is named by --out and by --pictures; name two files")
        described = collect(ProblemOptions, arguments)
        case = rate_coarsening(
            described, arguments.modes, arguments.refine_to, arguments.timed_modes
        )
        origin = measured(parameters(arguments))
        case.values["provenance"] = origin
        if arguments.pictures is not None:
            write_pictures(arguments.pictures, case.problem.fine, case.pictures, origin)
        write_json(arguments, case.values)
    if arguments.json:
        print(json.dumps(case.values, indent=2))
    else:
        _print_errors(case.values)


def _print_errors(case: dict[str, Any]) -> None:
    print(
        f"{case['n_dofs']:,} unknowns; frequency errors of modes 7 to "
        f"{case['plain']['by_index']['last']} against SLEPc on the fine mesh"
    )
    heads = "".join(f"{head:>24s}" for head in ("by index", "recognised shapes", "expected"))
    print(f"{'':<8s}{'unknowns':>10s}{heads}")
    print(f"{'':<18s}{'     rms     worst  mode' * 3}  rank correlation")
    for name in ("plain", "refined"):
        model = case[name]
        errors = "".join(_errors(model[key]) for key in SHOWN)
        correlation = model["rank_correlation"]
        shown = "-" if correlation is None else f"{correlation:.2f}"
        print(f"{name:<8s}{model['n_dofs']:10,}{errors}{shown:>18s}")
    for method, name in (("auto", "the default method"), ("slepc", "SLEPc")):
        print(_costs(name, case["costs"][method]))
    for name in ("plain", "refined"):
        for mode in case[name]["far_off"]:
            print(f"{name}: {_far_off(mode)}")


def _costs(method: str, costs: dict[str, Any]) -> str:
    reason = "" if costs["reason"] is None else f", since {costs['reason']}"
    fine, coarse = (costs[name]["processor_seconds"] for name in ("fine", "coarse"))
    return (
        f"{costs['modes']} modes by {method}: {fine:.2f} s of processors for the fine solid, "
        f"{coarse:.2f} s with a coarse model, {costs['faster']:.2f} times as fast; the "
        f"{costs['taken']} one was taken{reason}"
    )


def _errors(errors: dict[str, Any]) -> str:
    if errors["rms"] is None:
        return f"{'-':>8s} {'-':>9s} {'-':>5s}"
    return f"{errors['rms']:8.1%} {errors['worst']:+9.1%} {errors['worst_mode']:5d}"


def _far_off(mode: dict[str, Any]) -> str:
    where = ""
    if mode["elements"]:
        place = ", ".join(f"{value:.3f}" for value in mode["elements"][0]["place"])
        where = f", error most at ({place}) m"
    return (
        f"mode {mode['mode']} {mode['error']:+.1%}, {mode['verdict']}: overlap "
        f"{mode['overlap']:.2f} with {mode['partner']} {mode['matched_error']:+.1%}; half of its "
        f"energy in {mode['half_of_energy']:.1%} of the cells{where}"
    )
