"""`python -m sound export`: a design for other tools."""

from __future__ import annotations

import argparse
from pathlib import Path

from carillon.arguments import whole_number
from carillon.errors import UserError

FORMATS = ("h5", "gltf", "glb", "dsp")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("design", metavar="DESIGN", help="design.h5")
    parser.add_argument(
        "--out",
        required=True,
        help="file to write: .h5 (embedded mesh with eigenpairs), .gltf, .glb, or .dsp (Faust)",
    )
    parser.add_argument("--format", choices=FORMATS, help="in place of the ending of --out")
    parser.add_argument(
        "--points",
        type=whole_number(0),
        default=0,
        help="for Faust: points to strike all over the surface, besides the targets' (default 0)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Write the file and say what it holds."""
    from carillon.files import require_writable
    from sound.design_file import read_design

    wanted = arguments.format or Path(arguments.out).suffix.lstrip(".").lower()
    if wanted not in FORMATS:
        raise UserError(
            f"--out {arguments.out}: the ending tells no format, expected one of "
            f".{', .'.join(FORMATS)}; or name it by --format"
        )
    require_writable(arguments.out)
    if Path(arguments.out).resolve() == Path(arguments.design).resolve():
        raise UserError(f"--out {arguments.out}: is the design itself; name another file")
    design = read_design(arguments.design)
    if wanted == "h5":
        from sound.export.embedded import write_embedded  # Loaded if needed: some take long.

        write_embedded(arguments.out, design, {"design": arguments.design})
    elif wanted == "dsp":
        from sound.export.faust import write_faust

        write_faust(arguments.out, design, arguments.points)
    else:
        from sound.export.gltf import write_gltf

        write_gltf(arguments.out, design, binary=wanted == "glb")
    print(
        f"{arguments.out}: {len(design.frequencies)} modes, {design.frequencies[0]:.4g} to "
        f"{design.frequencies[-1]:.4g} Hz, {Path(arguments.out).stat().st_size:,} bytes"
    )
    return 0
