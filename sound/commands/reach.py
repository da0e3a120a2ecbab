"""`carillon reach`: which of the targets that a design misses its solid can meet.

For every mode that misses its target: whether a material meets it, alone and together with its
neighbours, or else how near one gets.  All frequencies are of the fine solid and relative to the
first mode.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any

from carillon.errors import UserError
from carillon.parameters import REQUIRED, option, parameters
from carillon.parameters.command_line import add_options, collect
from carillon.parameters.quantities import Positive, Workers, between
from carillon.records.measurement import measured

if TYPE_CHECKING:  # Their imports take long, and `--help` needs none.
    from sound.design.reach import Reach
    from sound.project.design import Design


@parameters
class ReachOptions:
    """What is asked, and how long an answer may take."""

    project: str = option(REQUIRED, "project file (YAML)")
    design: str = option(REQUIRED, "its design.h5")
    seconds: Positive = option(120.0, "processor time in which descents begin")
    descents: Annotated[int, between(1, 1000)] = option(3, "descents for each question at most")
    workers: Workers | None = option(None, "processes, not the project's")
    unless_fall: Annotated[float, between(0.0, 1.0)] | None = option(
        None,
        "ask nothing of a design whose cost fell by this share or more",
        metavar="SHARE",
    )
    json: bool = option(False, "print as JSON")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_options(parser, ReachOptions, positional=("project", "design"))


def run(arguments: argparse.Namespace) -> int:
    """Search and print."""
    from sound.design.objective import fall
    from sound.design.preparation import prepare, require_same_voxels
    from sound.design.reach import reach
    from sound.project.design_file import read_design
    from sound.project.project import load_project, with_optimiser

    options = collect(ReachOptions, arguments)
    project = with_optimiser(load_project(options.project), workers=options.workers)
    design = read_design(options.design)
    _require_same_targets(options, [target.name for target in project.targets], design)
    start, cost = (design.evidence.get(key) for key in ("cost_start", "cost"))
    if start is None or cost is None:
        raise UserError(
            f"{options.design}: does not tell how its cost fell, expected a design that carillon "
            "design found; design it anew"
        )
    content: dict[str, Any] = {"fall": fall(start, cost)}
    if options.unless_fall is None or content["fall"] < options.unless_fall:
        problem = prepare(project, design.targets)
        require_same_voxels(problem, design)
        result = reach(problem, design, options.seconds, options.descents)
        content |= asdict(result)
    if options.json:
        print(json.dumps({**content, "provenance": measured(project.as_dict())}))
    elif "modes" in content:
        print("\n".join(_lines(result)))
    else:
        print(f"{options.design}: cost fell by {content['fall']:.1%}, nothing is asked")
    return 0


def _require_same_targets(options: ReachOptions, names: list[str], design: Design) -> None:
    if names != list(design.targets.names):
        raise UserError(
            f"{options.design} is a design for {', '.join(design.targets.names)}, expected one for "
            f"the targets of {options.project}: {', '.join(names)}; design it anew"
        )


def _lines(result: Reach) -> list[str]:
    heads = ("target Hz", "cents", "alone", "beside")
    lines = ["  ".join(["mode", *(f"{head:>10}" for head in heads), "verdict"])]
    for each in result.modes:
        values = (each.cents, each.alone_cents, each.beside_cents)
        columns = [f"{each.target_hz:10.2f}", *(f"{value:10.1f}" for value in values)]
        lines.append("  ".join([f"{each.mode:4}", *columns, each.verdict]))
    lines.append(
        f"the first {result.together} of {len(result.modes) + 1} modes were had together, "
        f"amplitudes aside; {result.seconds:.1f} s"
    )
    return lines
