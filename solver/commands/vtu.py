"""Modes for ParaView, PyVista and meshio, with mesh and material.

A name that ends in .vtu gets all modes as vectors at the points, Young's modulus and density of the
cells, frequencies and residuals. One that ends in .pvd gets the motion of one mode: a list of
files, one for each phase of a period, whose cells are moved.
"""

import argparse
from pathlib import Path

from carillon.errors import UserError
from carillon.files.paths import require_writable
from carillon.parameters.command_line import add_options, collect
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
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("file", metavar="MODES", help="modes file")
    parser.add_argument("--out", required=True, help="file to write: .vtu, or .pvd with --mode")
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
    require_writable(arguments.out, [arguments.file])
    spectrum = StreamedModes.of_file(arguments.file)
    hertz = spectrum.frequencies
    if motion.mode is None:
        write_all_modes(arguments.out, spectrum)
        size = Path(arguments.out).stat().st_size
        print(f"{arguments.out}: {len(hertz)} modes up to {hertz[-1]:.4g} Hz, {size:,} bytes")
        return
    frames = write_motion(arguments.out, spectrum, motion)
    size = sum(frame.stat().st_size for frame in frames)
    print(
        f"{arguments.out}: mode {motion.mode}, {hertz[motion.mode - 1]:.4g} Hz, in {len(frames)} "
        f"files {frames[0].name} to {frames[-1].name}, {size:,} bytes"
    )
