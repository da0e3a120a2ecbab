"""Find the constants of the objective `calibrated` from spectra of random solids and objects.

The solids' exact spectra are kept, so that an interrupted calibration goes on.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from carillon.arguments import number_of_workers, whole_number
from carillon.fem.element import DEFAULT_POISSON
from carillon.files import atomic_path
from carillon.provenance import record
from solver.commands.running import on_ranks, require_outputs
from solver.studies.calibration.constants import CalibrationConstants
from solver.studies.calibration.exact import make_cases
from solver.studies.calibration.gauss_newton import calibrate_in_turn, log_step, rms_by_material

EXAMPLES = """example:
  calibrate --workers 2 --cases calibration/cases --out calibration.json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument(
        "--solids", type=whole_number(1, 100_000), default=150, help="random solids (default 150)"
    )
    parser.add_argument("--random-only", action="store_true", help="leave the built-in objects out")
    parser.add_argument("--seed", type=whole_number(0), default=0, help="of the solids")
    parser.add_argument(
        "--steps",
        type=whole_number(1, 10_000),
        default=10,
        help="Gauss-Newton steps at most (default 10)",
    )
    parser.add_argument("--workers", type=number_of_workers, default=1, help="processes")
    parser.add_argument(
        "--cases", required=True, help="folder that keeps the solids' exact spectra"
    )
    parser.add_argument("--out", required=True, help="JSON file to write")


def run(arguments: argparse.Namespace) -> None:
    """Compute the spectra that are missing, fit the constants, write them."""
    with on_ranks():
        require_outputs(arguments)
        cases = Path(arguments.cases)
        paths = make_cases(
            cases, arguments.seed, arguments.solids, objects=not arguments.random_only
        )
        start = CalibrationConstants.neutral()
        calibration = calibrate_in_turn(
            paths, start, DEFAULT_POISSON, arguments.workers, arguments.steps, report=log_step
        )
        source = record(
            {name: getattr(arguments, name) for name in ("solids", "random_only", "seed", "steps")}
        )
        del source[
            "command"
        ]  # It names folders of this machine, and the file goes into the package.
        content = {
            **calibration.constants.as_json(),
            "provenance": {
                **source,
                "settled": calibration.settled,
                "rms_before": rms_by_material(paths, start, arguments.workers),
                "rms_after": rms_by_material(paths, calibration.constants, arguments.workers),
            },
        }
    with atomic_path(arguments.out) as temporary:
        temporary.write_text(json.dumps(content, indent=1) + "\n")
