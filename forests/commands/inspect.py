"""Validate a file of forests, and say what is in it."""

from __future__ import annotations

import argparse
import json

from forests import summary
from forests.default import default_path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("file", nargs="?", help="by default that of the forests of Carillon")
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(arguments: argparse.Namespace) -> None:
    """Read the forests and print their summary."""
    description = summary.describe(default_path() if arguments.file is None else arguments.file)
    print(json.dumps(description, indent=2) if arguments.json else summary.as_text(description))
