"""Command line: `python -m forests COMMAND`; `--help` lists the commands."""

import sys
from collections.abc import Sequence

from carillon.command_line.commands import run_room


def main(words: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit status, the same on every rank."""
    return run_room("forests", "Regression forests that coarsen 2x2x2 blocks.", words)


if __name__ == "__main__":
    sys.exit(main())
