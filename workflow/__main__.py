"""Command line: `python -m workflow COMMAND`; `--help` lists the commands."""

import sys
from collections.abc import Sequence

from carillon.command_line.commands import run_room


def main(words: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit status."""
    return run_room("workflow", "Around the rules: before, after, and for one solid.", words)


if __name__ == "__main__":
    sys.exit(main())
