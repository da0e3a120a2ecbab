"""Modes for ParaView, PyVista and meshio, with mesh and material.

A name that ends in .vtu gets all modes as vectors at the points, Young's modulus and density of the
cells, frequencies and residuals. One that ends in .pvd gets the motion of one mode: a list of
files, one for each phase of a period, whose cells are moved. Cells are cubes, or with --surface the
triangles of the mesh, which are smooth.
"""

import argparse
from pathlib import Path

from carillon.errors import UserError
from carillon.files.paths import require_writable
from carillon.parameters.command_line import add_options, collect, reader
from carillon.parameters.quantities import MetresPerUnit
from solver.analysis.solid_surface import SolidSurface
from solver.exchange.displayed import displayed_surface
from solver.exchange.modes_vtu import (
    PVD,
    VTU,
    MotionOptions,
    StreamedModes,
    write_all_modes,
    write_motion,
)

EXAMPLES = """examples:
  vtu bell.h5 --out bell.vtu
  vtu bell.h5 --mode 7 --frames 24 --out bell7.pvd
  vtu bell.h5 --surface builtin:bell --out bell-surface.vtu
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("file", metavar="MODES", help="modes file")
    parser.add_argument("--out", required=True, help="file to write: .vtu, or .pvd with --mode")
    parser.add_argument(
        "--surface",
        metavar="MESH",
        help="mesh of the solid, or builtin:NAME, to show its surface; of a wall, both sides",
    )
    parser.add_argument(
        "--unit",
        type=reader(MetresPerUnit),
        default=1.0,
        help="unit of that mesh: m, cm, mm, um or in, or a number of metres (default: 1)",
    )
    add_options(parser, MotionOptions)


def run(arguments: argparse.Namespace) -> None:
    """Read, write and say what was written."""
    motion = collect(MotionOptions, arguments)
    ending = Path(arguments.out).suffix.lower()
    expected = VTU if motion.mode is None else PVD
    if ending != expected:
        reason = "all modes are written" if motion.mode is None else "the motion of a mode is"
        raise UserError(
            f"{arguments.out}: ends in {ending or 'nothing'}, expected {expected}, as {reason}"
            f"{' without --mode' if motion.mode is None else ' a list of files'}"
        )
    inputs = [arguments.file, *([arguments.surface] if arguments.surface else [])]
    require_writable(arguments.out, inputs)
    spectrum = StreamedModes.of_file(arguments.file)
    shown = None
    if arguments.surface:
        surface = SolidSurface.read(arguments.surface, arguments.unit, spectrum.wall, spectrum.up)
        shown = displayed_surface(spectrum.model, surface.triangles, arguments.surface)
    hertz = spectrum.frequencies
    if motion.mode is None:
        write_all_modes(arguments.out, spectrum, shown)
        size = Path(arguments.out).stat().st_size
        print(f"{arguments.out}: {len(hertz)} modes up to {hertz[-1]:.4g} Hz, {size:,} bytes")
        return
    frames = write_motion(arguments.out, spectrum, motion, shown)
    size = sum(frame.stat().st_size for frame in frames)
    print(
        f"{arguments.out}: mode {motion.mode}, {hertz[motion.mode - 1]:.4g} Hz, in {len(frames)} "
        f"files {frames[0].name} to {frames[-1].name}, {size:,} bytes"
    )
