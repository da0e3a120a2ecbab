"""Command line: `carillon COMMAND`, all commands by one name; `--help` lists them.

`python -m dataset_gen`, `forests`, `solver`, `sound`, `studio` and `workflow` have the same
commands, some of them by shorter names. `carillon study` lists the studies; those that were
commands of a room before are still found by their names alone.
"""

import sys
from collections.abc import Sequence
from importlib import import_module

from carillon import ROOMS
from carillon.command_line.commands import Command, run_program

LONGER = {"dataset_gen": {"inspect": "inspect-shard"}, "forests": {"inspect": "inspect-forests"}}
"""Names of commands of a room that another room has too."""
STUDY = "study"
REMOVED = {"calibrate": "which is gone: the constants of the objective calibrated are kept"}
"""Commands of earlier versions that are gone, with a sentence on what became of each."""


def commands() -> dict[str, Command]:
    """All commands by name, but those of the studies."""
    by_name = {
        "environment": Command(
            "carillon.command_line.environment", "versions, BLAS and cores in use"
        )
    }
    for room in ROOMS[1:-1]:
        own: dict[str, Command] = import_module(f"{room}.commands").COMMANDS
        by_name |= {LONGER.get(room, {}).get(name, name): command for name, command in own.items()}
    return by_name | {STUDY: Command("studies", "run a study; `carillon study --help` lists them")}


def studies() -> dict[str, Command]:
    """Commands of the studies by name."""
    commands: dict[str, Command] = import_module("studies").commands()
    return commands


def main(words: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit status, the same on every rank."""
    given = sys.argv[1:] if words is None else list(words)
    if given[:1] == [STUDY]:
        description = "Experiments: what was measured, and the pages that show it."
        words = given[1:] or ["--help"]
        return run_program(f"carillon {STUDY}", description, studies(), words)
    description = (
        "Vibration modes of solids with spatially varying material, fast enough to design sound."
    )
    known = studies()
    older = {name: command for name, command in known.items() if command.room}
    elsewhere = {name: f"did you mean 'carillon {STUDY} {name}'?" for name in known}
    return run_program("carillon", description, commands(), given, older, elsewhere | REMOVED)


if __name__ == "__main__":
    sys.exit(main())
