"""`python -m sound export`: a design for other tools."""

from __future__ import annotations

import argparse
from pathlib import Path

from carillon.arguments import whole_number
from carillon.errors import UserError

FORMATS = ("h5", "gltf", "glb", "dsp")
MOST_POINTS = 10_000
"""To strike in a Faust program, each of which is an entry of its menu."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("design", metavar="DESIGN", help="design.h5")
    parser.add_argument(
        "--out",
        required=True,
        help="file to write: .h5 (embedded mesh with eigenpairs), .gltf, .glb, or .dsp (Faust)",
    )
    parser.add_argument("--format", choices=FORMATS, help="where --out has another ending")
    parser.add_argument(
        "--points",
        type=whole_number(0, MOST_POINTS),
        default=0,
        help="for Faust: points to strike all over the surface, besides the targets' (default 0)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Write the file and say what it holds."""
    from sound.outputs import require_output
    from sound.project.design_file import read_design

    kind = _format(arguments.out, arguments.format)
    require_output(arguments.out, [Path(arguments.out).suffix.lower()], [arguments.design])
    design = read_design(arguments.design)
    if kind == "h5":
        from sound.export.embedded import write_embedded  # Loaded if needed: some take long.

        write_embedded(arguments.out, design, {"design": arguments.design})
    elif kind == "dsp":
        from sound.export.faust import write_faust

        write_faust(arguments.out, design, arguments.points)
    else:
        from sound.export.gltf import write_gltf

        write_gltf(arguments.out, design, binary=kind == "glb")
    print(
        f"{arguments.out}: {len(design.frequencies)} modes, {design.frequencies[0]:.4g} to "
        f"{design.frequencies[-1]:.4g} Hz, {Path(arguments.out).stat().st_size:,} bytes"
    )
    return 0


def _format(out: str, named: str | None) -> str:
    """What is written: as named, or as the ending tells; the two must not contradict each other."""
    ending = Path(out).suffix.lstrip(".").lower()
    if named is not None and ending in FORMATS and ending != named:
        raise UserError(
            f"--out {out}: ends in .{ending}, but --format is {named}; leave one of them"
        )
    if named is None and ending not in FORMATS:
        raise UserError(
            f"--out {out}: the ending tells no format, expected one of .{', .'.join(FORMATS)}; or "
            "name it by --format"
        )
    return named or ending
