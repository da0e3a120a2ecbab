"""Command line: `python -m studio studio`."""

import sys
from collections.abc import Sequence

from carillon.command_line.commands import run_program
from studio.commands import COMMANDS


def main(words: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit status."""
    return run_program("studio", "Design of sounds in the browser.", COMMANDS, words)


if __name__ == "__main__":
    sys.exit(main())
