"""Command line: `python -m solver COMMAND`; `--help` lists the commands."""

import sys
from collections.abc import Sequence

from carillon.command_line.commands import run_room


def main(words: Sequence[str] | None = None) -> int:
    """Run one command; every rank returns the same status, or the whole job is aborted."""
    return run_room("solver", "Vibration modes of solids with spatially varying material.", words)


if __name__ == "__main__":
    sys.exit(main())
