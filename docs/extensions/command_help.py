"""Help of the commands as Markdown, from the parsers that the commands themselves use."""

import argparse
import os
from collections.abc import Iterator
from importlib import import_module

from carillon import ROOMS
from carillon.__main__ import LONGER, STUDY, commands, studies
from carillon.command_line.arguments import Parser
from carillon.command_line.commands import Command

COLUMNS = "76"
"""Width of the help: what fits beside the contents on a screen."""


def of_room(room: str) -> str:
    """Sections with the commands of a room; those of no room for `carillon`."""
    return "\n".join(_section(room, *found) for found in _listed(room))


def _listed(room: str) -> Iterator[tuple[str, str | None, Command]]:
    if room == "studies":
        yield from (
            (f"{STUDY} {name}", each.in_room or name, each) for name, each in studies().items()
        )
        return
    everything = commands()
    del everything[STUDY]
    if room in ROOMS[1:]:
        for own in import_module(f"{room}.commands").COMMANDS:
            name = LONGER.get(room, {}).get(own, own)
            yield name, own, everything.pop(name)
        return
    in_rooms = {name for each in ROOMS[1:-1] for name, _, _ in _listed(each)}
    yield from ((name, None, everything[name]) for name in everything if name not in in_rooms)


def help_of(name: str, command: Command) -> str:
    """What `carillon NAME --help` prints."""
    module = import_module(command.module)
    parser = Parser(
        prog=f"carillon {name}",
        description=module.__doc__,
        epilog=getattr(module, "EXAMPLES", None),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    module.add_arguments(parser)
    before = os.environ.get("COLUMNS")
    os.environ["COLUMNS"] = COLUMNS
    try:
        return parser.format_help()
    finally:
        os.environ.pop("COLUMNS")
        if before is not None:
            os.environ["COLUMNS"] = before


def _section(room: str, name: str, own: str | None, command: Command) -> str:
    room = command.room if room == "studies" else room
    also = f" Also `python -m {room} {own}`." if own is not None and room else ""
    ranks = " It may be started on several MPI ranks." if command.ranks else ""
    summary = command.summary[0].upper() + command.summary[1:]
    return (
        f"## `carillon {name}`\n\n{summary}.{also}{ranks}\n\n"
        f"```text\n{help_of(name, command).rstrip()}\n```\n"
    )
