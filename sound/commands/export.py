"""`carillon export`: a design for other tools."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from carillon.parameters import REQUIRED, OneOf, option, parameters
from carillon.parameters.command_line import add_options, collect
from carillon.parameters.quantities import between
from sound.commands.common_options import DampingOptions
from sound.export.formats import FORMATS, format_of

if TYPE_CHECKING:  # Its import takes long, and `--help` needs none.
    from sound.project.design import Design

MOST_POINTS = 10_000
"""To strike in a Faust program, each of which is an entry of its menu."""


@parameters
class ExportOptions:
    """What is exported, and how."""

    design: str = option(REQUIRED, "design.h5")
    out: str = option(
        REQUIRED,
        "file to write: .h5 (embedded mesh with eigenpairs), .gltf, .glb, .dsp (Faust), or .npy "
        "(Young's moduli [Pa] of the fine cells, for carillon modes --material)",
    )
    format: Annotated[str, OneOf(*FORMATS)] | None = option(None, "where --out has another ending")
    points: Annotated[int, between(0, MOST_POINTS)] = option(
        0,
        "for Faust: points to strike all over the surface, besides the targets'",
    )


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_options(parser, ExportOptions, positional=("design",))
    add_options(parser, DampingOptions)


def run(arguments: argparse.Namespace) -> int:
    """Write the file and say what it holds."""
    from sound.export.formats import export_design
    from sound.outputs import require_output
    from sound.project.design_file import read_design

    options = collect(ExportOptions, arguments)
    kind = format_of(options.out, options.format)
    require_output(options.out, [Path(options.out).suffix.lower()], [options.design])
    design = read_design(options.design).damped_by(collect(DampingOptions, arguments).damping_from)
    export_design(options.out, design, kind, options.points, options.design)
    print(f"{options.out}: {_content(kind, design)}, {Path(options.out).stat().st_size:,} bytes")
    return 0


def _content(kind: str, design: Design) -> str:
    from sound.export.formats import exported_moduli, has_table

    if kind == "npy":
        young, model = exported_moduli(design), design.model
        text = (
            f"{len(young):,} moduli, {young.min() / 1e9:.3g} to {young.max() / 1e9:.3g} GPa, for "
        )
        if has_table(design):
            return f"{text}--regions: factors on those of the regions, times 1 GPa"
        return f"{text}--density {model.density:.6g} --poisson {model.poisson:.6g}"
    hertz = design.frequencies
    return f"{len(hertz)} modes, {hertz[0]:.4g} to {hertz[-1]:.4g} Hz"
