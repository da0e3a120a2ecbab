"""`carillon check`: frequencies of a design on the fine solid, beside its targets.

The search of `design` works on a coarse solid.  Here the modes of its material are computed on all
voxels, and the frequencies of both solids are compared with the targets.
"""

from __future__ import annotations

import argparse
import json
from typing import TYPE_CHECKING, Any

from carillon.parameters import REQUIRED, option, parameters
from carillon.parameters.command_line import add_options, collect

if TYPE_CHECKING:  # Their imports take long, and `--help` needs none.
    from sound.project.design import Design, FineFrequencies


@parameters
class CheckOptions:
    """What is checked."""

    design: str = option(REQUIRED, "design.h5")
    json: bool = option(False, "print as JSON")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_options(parser, CheckOptions, positional=("design",))


def run(arguments: argparse.Namespace) -> int:
    """Solve and print."""
    from sound.design.fine_check import fine_frequencies
    from sound.project.design_file import read_design

    options = collect(CheckOptions, arguments)
    design = read_design(options.design)
    content = comparison(design, fine_frequencies(design))
    print(json.dumps(content) if options.json else "\n".join(_lines(content)))
    return 0


def comparison(design: Design, fine: FineFrequencies) -> dict[str, Any]:
    """Targets, coarse and fine frequencies of a design, mode by mode; silent ones have no target.

    Coarse frequencies are those of the coarse modes that have the shapes of the fine ones.
    """
    from sound.design.pitch import bark, cents, partials_alone, rms_off_partials

    aims, targets = design.targets, design.targets.frequencies
    coarse = design.coarse_frequencies[fine.order]
    return {
        "target_hz": partials_alone(targets, aims),
        "coarse_hz": coarse.tolist(),
        "fine_hz": fine.hertz.tolist(),
        "coarse_cents": partials_alone(cents(coarse, targets), aims),
        "fine_cents": partials_alone(cents(fine.hertz, targets), aims),
        "fine_bark": partials_alone(bark(fine.hertz) - bark(targets), aims),
        "coarse_rms_cents": rms_off_partials(design.coarse_frequencies, aims),
        "fine_rms_cents": rms_off_partials(fine.hertz, aims),
        "voxels": len(design.young),
        "coarse_cells": design.model.mesh.n_cells,
    }


def _lines(content: dict[str, Any]) -> list[str]:
    names = ("target_hz", "coarse_hz", "fine_hz", "coarse_cents", "fine_cents", "fine_bark")
    heads = ("target Hz", "coarse Hz", "fine Hz", "coarse cents", "fine cents", "fine bark")
    lines = ["  ".join(["mode", *(f"{head:>12}" for head in heads)])]
    for mode, row in enumerate(zip(*(content[name] for name in names)), 1):
        digits = (2, 2, 2, 1, 1, 3)
        columns = [
            f"{'silent' if column == 0 else '':>12}" if value is None else f"{value:12.{places}f}"
            for column, (value, places) in enumerate(zip(row, digits))
        ]
        lines.append("  ".join([f"{mode:4}", *columns]))
    coarse, fine = content["coarse_rms_cents"], content["fine_rms_cents"]
    lines.append(
        f"from their targets, but for a common factor (rms): {coarse:.1f} cents on the coarse "
        f"solid of {content['coarse_cells']:,} cells, {fine:.1f} on the fine one of "
        f"{content['voxels']:,} voxels"
    )
    return lines
