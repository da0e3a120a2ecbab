"""Command line: `carillon COMMAND`, all commands by one name; `--help` lists them.

`python -m dataset_gen`, `forests`, `solver`, `sound`, `studio` and `workflow` have the same
commands, some of them by shorter names.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import import_module

from carillon import ROOMS
from carillon.commands import Command, run_program

LONGER = {
    "dataset_gen": {"benchmark": "benchmark-fits", "inspect": "inspect-shard"},
    "forests": {"benchmark": "benchmark-forests", "inspect": "inspect-forests"},
    "sound": {"benchmark": "benchmark-design"},
    "workflow": {"compare": "compare-runs"},
}
"""Names of commands of a room that another room has too."""


def commands() -> dict[str, Command]:
    """All commands by name."""
    by_name = {"environment": Command("carillon.environment", "versions, BLAS and cores in use")}
    for room in ROOMS[1:]:
        own: dict[str, Command] = import_module(f"{room}.commands").COMMANDS
        by_name |= {LONGER.get(room, {}).get(name, name): command for name, command in own.items()}
    return by_name


def main(words: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit status, the same on every rank."""
    description = (
        "Vibration modes of solids with spatially varying material, fast enough to design sound."
    )
    return run_program("carillon", description, commands(), words)


if __name__ == "__main__":
    sys.exit(main())
