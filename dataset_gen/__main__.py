"""Command line: `python -m dataset_gen generate | benchmark | inspect`."""

import sys
from collections.abc import Sequence

from carillon.command_line.commands import run_room


def main(words: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit status, the same on every rank."""
    return run_room("dataset_gen", "Training data of the coarsening forests.", words)


if __name__ == "__main__":
    sys.exit(main())
