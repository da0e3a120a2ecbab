"""Strike a solid: its motion and sound by several spectra, one being taken for the truth."""

import argparse
from pathlib import Path

from carillon.errors import UserError
from carillon.parameters.command_line import add_options, collect
from solver.commands.running import on_ranks, parameters, require_outputs
from solver.response.response_file import TRUTH, StrikeOptions, respond, write_response

EXAMPLES = """example:
  respond truth.h5 bunny.h5 --out response.h5
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("truth", help="modes file taken for the truth")
    parser.add_argument(
        "candidates", nargs="*", metavar="FILE", help="modes files to set beside it"
    )
    parser.add_argument("--out", required=True, help="file to write (HDF5)")
    add_options(parser, StrikeOptions)


def run(arguments: argparse.Namespace) -> None:
    """Strike, write and say how much the spectra differ."""
    with on_ranks():
        require_outputs(arguments)
        candidates = {Path(path).stem: path for path in arguments.candidates}
        if len(candidates) < len(arguments.candidates) or TRUTH in candidates:
            names = ", ".join(sorted(Path(path).stem for path in arguments.candidates))
            raise UserError(
                f"files called {names}: expected names that differ from each other and from "
                f"{TRUTH!r}; rename one"
            )
        study = respond(arguments.truth, candidates, collect(StrikeOptions, arguments))
        write_response(arguments.out, study, parameters(arguments))
    for name, response in study.responses.items():
        print(
            f"{name}: differs from {arguments.truth} by {response.difference:.2e} in displacement, "
            f"{response.distance_decibels:.2g} dB in sound"
        )
