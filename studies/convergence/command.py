"""Follow the eigenvalues through the corrections, from several starts (Fig. 10)."""

import argparse

from carillon.parameters.command_line import collect, reader
from carillon.parameters.quantities import Corrections, NumberOfModes
from carillon.records.measurement import measured
from solver.analysis.problem import ProblemOptions, build_problem
from solver.commands.running import add_solid, on_ranks, parameters, require_outputs, write_json
from solver.distribution.collective import compute_on_root
from studies.convergence.measure import correction_history

EXAMPLES = """example:
  convergence builtin:bell --resolution 24 --modes 100 --out history.json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_solid(parser)
    parser.add_argument(
        "--modes", type=reader(NumberOfModes), default=256, help="rigid included (default 256)"
    )
    parser.add_argument(
        "--steps", type=reader(Corrections), default=3, help="corrections (default 3)"
    )
    parser.add_argument(
        "--truth",
        help="modes file with the exact eigenvalues (default: SLEPc or else ARPACK finds them)",
    )
    parser.add_argument("--out", required=True, help="JSON file to write")


def run(arguments: argparse.Namespace) -> None:
    """Follow the corrections and write their errors."""
    with on_ranks() as comm:
        require_outputs(arguments, comm)
        described = collect(ProblemOptions, arguments)
        problem = compute_on_root(comm, lambda: build_problem(described))
        model = None if problem is None else problem.model
        history = correction_history(
            model, arguments.modes, arguments.steps, arguments.seed, arguments.truth, comm
        )
        history["provenance"] = measured(parameters(arguments), comm.size)
        write_json(arguments, history, comm)
