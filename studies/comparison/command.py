"""`carillon study compare-runs BASELINE RESULTS`: two runs side by side."""

import argparse
import json

from carillon.errors import UserError
from studies.comparison import report
from studies.comparison.comparison import compare
from studies.comparison.folders import read_folder, require_apart
from studies.comparison.noise import WORSE

EXIT_WORSE = 1


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument("before", metavar="BASELINE", help="folder of results, or a reference")
    parser.add_argument("now", metavar="RESULTS", help="folder of results to set beside it")
    parser.add_argument("--out", metavar="FOLDER", help="write comparison.csv, .md and .html there")
    parser.add_argument("--json", action="store_true", help="print what differs and moved as JSON")
    parser.add_argument(
        "--fail-on-move", action="store_true", help="exit status 1 if anything moved for the worse"
    )


def run(arguments: argparse.Namespace) -> int:
    """Compare two folders.

    Raises UserError if one does not exist or holds no tables, or if they have none in common.
    """
    before, now = read_folder(arguments.before), read_folder(arguments.now)
    out = None if arguments.out is None else require_apart(arguments.out, before, now)
    comparison = compare(before, now)
    if comparison.cells.empty:
        raise UserError(
            f"{arguments.before} and {arguments.now} have no table and row in common; expected "
            "results of the same models"
        )
    if out is not None:
        report.write(comparison, out)
    if arguments.json:
        print(json.dumps(report.as_json(comparison), indent=1))
    else:
        print(report.as_text(comparison))
        if out is not None:
            print(f"all of it: {out / report.NAME}.html")
    worse = comparison.moved["verdict"].isin(WORSE).any()
    return EXIT_WORSE if arguments.fail_on_move and worse else 0
