"""Validate a shard of training data, and say what is in it."""

from __future__ import annotations

import argparse
import json

from carillon.command_line.progress import say
from dataset_gen import summary
from dataset_gen.speed import Speed


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("file", help="shard (HDF5)")
    parser.add_argument("--json", action="store_true", help="print JSON")


def run(arguments: argparse.Namespace) -> None:
    """Read all of the shard and print its summary."""
    speed = Speed()
    description = summary.describe(arguments.file)
    first, past = description["samples"]
    say(f"read {speed.report(arguments.file, past - first)}")
    print(json.dumps(description, indent=2) if arguments.json else summary.as_text(description))
