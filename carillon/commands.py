"""Programs made of commands, each a module that is imported only when it is asked for."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import import_module

from carillon import __version__, cli, present_folder, step
from carillon.arguments import Parser
from carillon.errors import UserError
from carillon.progress import say
from carillon.ranks import world
from carillon.waiting import leave_cores


@dataclass(frozen=True)
class Command:
    """A command and where it is found.

    Attributes
    ----------
    module
        Has `add_arguments(parser)` and `run(arguments)`, which returns an exit status or None for
        success; its docstring is the command's description, `EXAMPLES` ends its help.
    summary
        What it does, for the list of commands.
    ranks
        Whether it may be started on several MPI ranks.
    """

    module: str
    summary: str
    ranks: bool = False


def run_program(
    name: str, description: str, commands: Mapping[str, Command], words: Sequence[str] | None = None
) -> int:
    """Run the command that a command line names; returns the exit status, the same on every rank.

    Parameters
    ----------
    name
        Of the program, for messages and help.
    words
        The command line, that of this process if None.
    """
    present_folder.ignore_modules(os.environ, sys.path)
    step.keep_apart(os.environ, os.getpid())
    chosen: list[argparse.Namespace] = []
    given = sys.argv[1:] if words is None else list(words)
    try:
        comm = world()
    except UserError as error:
        say(f"{name}: {error}")
        return cli.EXIT_BAD_INPUT
    if comm is not None:
        leave_cores(comm)
    elif lonely := step.lonely_among(os.environ):
        say(f"warning: {lonely}")

    def parse() -> None:
        chosen.append(_parser(name, description, commands, given).parse_args(given))
        command = chosen[0].command
        if comm is not None and not commands[command].ranks:
            chosen.clear()
            raise UserError(
                f"{command} runs as one process, {comm.size} ranks were started; of the commands "
                f"{', '.join(each for each in commands if commands[each].ranks) or 'none'} "
                "run on several"
            )

    status = cli.run(name, parse, comm)
    if comm is not None and not chosen:
        comm.Barrier()  # nobody ends before the first rank has told what is wrong
    for arguments in chosen:
        module = import_module(commands[arguments.command].module)
        status = cli.run(f"{name} {arguments.command}", partial(module.run, arguments), comm)
    return status


def _parser(
    name: str, description: str, commands: Mapping[str, Command], words: Sequence[str]
) -> Parser:
    """Parser of a program, with the arguments of the one command that `words` begin with."""
    parser = Parser(prog=name, description=description)
    parser.add_argument("--version", action="version", version=f"Carillon {__version__}")
    parts = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for each, command in commands.items():
        module = import_module(command.module) if words and words[0] == each else None
        part = parts.add_parser(
            each,
            help=command.summary,
            description=None if module is None else module.__doc__,
            epilog=getattr(module, "EXAMPLES", None),
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        if module is not None:
            module.add_arguments(part)
    return parser
