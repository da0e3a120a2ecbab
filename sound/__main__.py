"""Command line: `python -m sound extract | clip | init | design | render | export | benchmark`."""

import sys
from collections.abc import Sequence

from carillon.command_line.commands import run_room


def main(words: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit status."""
    return run_room("sound", "From example clips to a material to a sound.", words)


if __name__ == "__main__":
    sys.exit(main())
