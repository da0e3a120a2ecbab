"""Check modes files by themselves: residuals, orthogonality, and a count of eigenvalues by inertia.

What is wrong is said in a sentence each; with --strict it makes the exit status 1. The matrices are
assembled anew from what the files say of the solid.
"""

import argparse
import json

from carillon.parameters.command_line import reader
from carillon.parameters.quantities import Tolerance
from carillon.records.provenance import record
from solver.commands.running import on_ranks, parameters, require_outputs, write_json
from solver.correction.criteria import EIGENVALUE_TOLERANCE
from solver.verification.audit import audit_files

EXAMPLES = """example:
  audit bunny.h5 truth.h5
"""

FAULTY = 1
"""Exit status with --strict if anything is wrong."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("files", nargs="+", metavar="FILE", help="modes files")
    parser.add_argument(
        "--tolerance",
        type=reader(Tolerance),
        default=EIGENVALUE_TOLERANCE,
        help="relative error that the eigenvalues were asked for to, which decides how wide the "
        "gap has to be below which they are counted (default: %(default)g)",
    )
    parser.add_argument(
        "--strict", action="store_true", help="exit with status 1 if anything is wrong"
    )
    parser.add_argument("--out", help="also write the result to this JSON file")
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(arguments: argparse.Namespace) -> int:
    """Audit and print."""
    with on_ranks():
        require_outputs(arguments)
        audited = audit_files(arguments.files, arguments.tolerance)
        audits = {name: audit.as_dict() for name, audit in audited.items()}
    content = {"spectra": audits, "provenance": record(parameters(arguments))}
    write_json(arguments, content)
    wrong = any(audit["faults"] for audit in audits.values())
    status = FAULTY if wrong and arguments.strict else 0
    if arguments.json:
        print(json.dumps(content, indent=2))
        return status
    for name, audit in audits.items():
        print(
            f"{name}: {audit['modes']} modes of {audit['unknowns']:,} unknowns, "
            f"{audit['rigid_modes']} rigid; largest 2-norm residual {audit['residual_max']:.1e}, "
            f"energy residual {max(audit['energy_residuals']):.1e}, "
            f"orthogonal to {audit['orthogonality']:.1e}; {audit['expected']} below "
            f"{audit['counted_below']:.6g} rad^2/s^2, counted {audit['counted']}"
        )
        for fault in audit["faults"] or ["nothing is wrong"]:
            print(f"    {fault}")
    return status
