"""What the studies of forests share: where their results go, with which origin."""

import argparse
import json

from carillon.files.atomic import atomic_path
from carillon.records.measurement import measured

HIDDEN = ("out", "json", "plot")
"""Arguments on which a result does not depend."""


def add_outputs(parser: argparse.ArgumentParser) -> None:
    """Add `--json` and `--out`."""
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--out", metavar="FILE", help="result and provenance, as JSON")


def publish(arguments: argparse.Namespace, result: object, text: str, threads: int) -> None:
    """Write a result with its provenance to the file that `--out` names, and print it."""
    if arguments.out is not None:
        given = {key: value for key, value in vars(arguments).items() if key not in HIDDEN}
        content = {"result": result, "provenance": measured(given, threads=threads)}
        with atomic_path(arguments.out) as temporary:
            temporary.write_text(json.dumps(content, indent=1))
    print(json.dumps(result, indent=2) if arguments.json else text)
