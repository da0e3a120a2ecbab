"""Rate coarse models of solids by Poisson's ratio: forests, fits at each ratio, Galerkin."""

import argparse

from carillon.parameters.command_line import add_options, collect, reader
from carillon.parameters.quantities import PoissonRatio, Positive
from solver.analysis.problem import ProblemOptions
from solver.commands.running import (
    COMPOSED,
    WALL,
    add_outputs,
    on_ranks,
    require_outputs,
    tell_measured,
)
from solver.refinement.errors import ALLOWED_ERROR
from studies.coarsening.ratios import RATIOS, lines_of, rate_ratios

EXAMPLES = """example:
  ratios builtin:box builtin:bell --resolution 16 --material noise --ratios 0.1 0.25 0.45
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("mesh", nargs="+", help="surface mesh files, or builtin:NAME")
    own = ("mesh", "poisson", "coarsen", "objective", "discretisation", *WALL, *COMPOSED)
    add_options(parser, ProblemOptions, leave_out=own)
    parser.add_argument(
        "--ratios",
        nargs="+",
        type=reader(PoissonRatio),
        default=list(RATIOS),
        metavar="RATIO",
        help=f"Poisson's ratios (default {' '.join(map(str, RATIOS))})",
    )
    parser.add_argument(
        "--refine-to",
        type=reader(Positive),
        default=ALLOWED_ERROR,
        metavar="ERROR",
        help="expected error of the frequencies down to which blocks stay fine in the refined "
        f"model (default {ALLOWED_ERROR:g})",
    )
    add_outputs(parser)


def run(arguments: argparse.Namespace) -> None:
    """Measure and print."""
    with on_ranks() as comm:
        require_outputs(arguments, comm)
        options = [
            collect(ProblemOptions, argparse.Namespace(**vars(arguments) | {"mesh": mesh}))
            for mesh in arguments.mesh
        ]
        result = rate_ratios(options, arguments.ratios, arguments.refine_to)
        tell_measured(arguments, result, lambda found: "\n".join(lines_of(found)), comm)
