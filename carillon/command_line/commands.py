"""Programs made of commands, each a module that is imported only when it is asked for."""

import argparse
import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from types import MappingProxyType
from typing import Any

from carillon import __version__
from carillon.command_line import exit_status
from carillon.command_line.arguments import Parser
from carillon.command_line.progress import say
from carillon.errors import UserError, on_all_ranks
from carillon.processes import kernel_cache, mpi_environment, present_folder
from carillon.processes.ranks import world
from carillon.processes.waiting import leave_cores

COMPILING = "compiling kernels for this processor, once: a minute or two"
"""Told on a terminal, where nothing else would be seen for that long."""


@dataclass(frozen=True)
class Command:
    """A command and where it is found."""

    module: str
    """Has `add_arguments(parser)` and `run(arguments)`, which returns an exit status or None for
    success; its docstring is the command's description, `EXAMPLES` ends its help. If it has the
    name `FURTHER`, arguments that it does not know are in `arguments.further`, in their order."""
    summary: str
    """One line of the list of commands: what the command does."""
    ranks: bool = False
    """Whether it may be started on several MPI ranks."""
    room: str = ""
    in_room: str = ""
    """Room that lists the command of a study, too, and the name there if that is another."""


def run_room(room: str, description: str, words: Sequence[str] | None = None) -> int:
    """Run a command of a room, or one of those that studies add to it, see `run_program`."""
    own: dict[str, Command] = import_module(f"{room}.commands").COMMANDS
    studied: dict[str, Command] = import_module("studies").commands()
    added = {each.in_room or name: each for name, each in studied.items() if each.room == room}
    return run_program(room, description, own | added, words)


def run_program(
    name: str,
    description: str,
    commands: Mapping[str, Command],
    words: Sequence[str] | None = None,
    unlisted: Mapping[str, Command] = MappingProxyType({}),
    elsewhere: Mapping[str, str] = MappingProxyType({}),
) -> int:
    """Run the command that a command line names; returns the exit status, the same on every rank.

    Parameters
    ----------
    name
        Of the program, for messages and help.
    words
        The command line, that of this process if None.
    unlisted
        Further commands, which the help does not list.
    elsewhere
        What to type in place of words that are no commands of this program.
    """
    present_folder.ignore_modules(os.environ, sys.path)
    mpi_environment.keep_apart(os.environ, os.getpid())
    chosen: list[argparse.Namespace] = []
    given = sys.argv[1:] if words is None else list(words)
    try:
        comm = world()
    except UserError as error:
        say(f"{name}: {error}")
        return exit_status.EXIT_BAD_INPUT
    if comm is not None:
        leave_cores(comm)
    elif lonely := mpi_environment.lonely_among(os.environ):
        say(f"warning: {lonely}")

    if sys.stderr.isatty() and (comm is None or comm.rank == 0):
        kernel_cache.tell_compilation(partial(say, COMPILING))
    everything = {**commands, **unlisted}

    @on_all_ranks()
    def parse() -> None:
        parser = _parser(name, description, commands, unlisted, given)
        parser.elsewhere = elsewhere
        arguments, arguments.further = parser.parse_known_args(given)
        command = arguments.command
        if arguments.further and not hasattr(_module(everything[command]), "FURTHER"):
            of_command = Parser(prog=f"{name} {command}")
            of_command.error(f"unrecognized arguments: {' '.join(arguments.further)}")
        chosen.append(arguments)
        if comm is not None and not everything[command].ranks:
            chosen.clear()
            raise UserError(
                f"{command} runs as one process, {comm.size} ranks were started; of the commands "
                f"{', '.join(each for each in everything if everything[each].ranks) or 'none'} "
                "run on several"
            )

    status = exit_status.run(name, parse, comm)
    if comm is not None and not chosen:
        comm.Barrier()  # nobody ends before the first rank has told what is wrong
    for arguments in chosen:
        module = _module(everything[arguments.command])
        status = exit_status.run(
            f"{name} {arguments.command}", partial(module.run, arguments), comm
        )
    return status


def _module(command: Command) -> Any:
    return import_module(command.module)


def _parser(
    name: str,
    description: str,
    commands: Mapping[str, Command],
    unlisted: Mapping[str, Command],
    words: Sequence[str],
) -> Parser:
    """Parser of a program, with the arguments of the one command that `words` begin with."""
    parser = Parser(prog=name, description=description)
    parser.add_argument("--version", action="version", version=f"Carillon {__version__}")
    parts = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for each, command in {**commands, **unlisted}.items():
        module = _module(command) if words and words[0] == each else None
        listed: dict[str, Any] = {"help": command.summary} if each in commands else {}
        part = parts.add_parser(
            each,
            **listed,
            description=None if module is None else module.__doc__,
            epilog=getattr(module, "EXAMPLES", None),
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        if module is not None:
            module.add_arguments(part)
    return parser
