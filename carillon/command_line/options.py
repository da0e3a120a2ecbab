"""Options that are described once, where they are defined: as fields of a dataclass.

Command lines are made from the fields, and what was given there is collected into the dataclass
again; the documentation shows the same words.
"""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Callable, Iterable, Sequence
from typing import Any, TypeVar

T = TypeVar("T")

REQUIRED: Any = dataclasses.MISSING
"""Default of an option that has none."""

_HELP = "help"


def option(
    default: Any,
    help: str,
    *,
    type: Callable[[str], Any] | None = None,
    choices: Iterable[str] | None = None,
    metavar: str | tuple[str, ...] | None = None,
    nargs: int | str | None = None,
) -> Any:
    """A field of a dataclass that is an option of commands.

    Parameters
    ----------
    default
        Its default; with `REQUIRED` it has to be given.
    help
        What it is, with its unit in brackets.
    type
        Reads it from a word, and refuses it with a reason, see `carillon.command_line.arguments`;
        not needed for switches and texts.
    """
    metadata = {
        _HELP: help,
        "type": type,
        "choices": None if choices is None else tuple(choices),
        "metavar": metavar,
        "nargs": nargs,
    }
    if default is REQUIRED:
        return dataclasses.field(metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


def add_options(
    parser: argparse._ActionsContainer,
    options: type,
    leave_out: Sequence[str] = (),
    positional: Sequence[str] = (),
) -> None:
    """Add the options of a dataclass to a command line.

    Parameters
    ----------
    parser
        The command line, or a group of it.
    options
        A dataclass with fields made by `option`; others are left alone.
    leave_out
        Names of fields that are no options of this command.
    positional
        Names of fields that are given by their place.
    """
    for field in dataclasses.fields(options):
        if field.name not in leave_out and _HELP in field.metadata:
            _add(parser, field, field.name in positional)


def collect(options: type[T], arguments: argparse.Namespace) -> T:
    """The dataclass from what a command line gave, its defaults for what the command leaves out."""
    names = {field.name for field in dataclasses.fields(options)}  # type: ignore[arg-type]
    return options(**{name: value for name, value in vars(arguments).items() if name in names})


def _add(
    parser: argparse._ActionsContainer, field: dataclasses.Field[Any], positional: bool
) -> None:
    default = field.default
    arguments = {key: value for key, value in field.metadata.items() if value is not None}
    if positional:
        parser.add_argument(field.name, **{"metavar": field.name.upper(), **arguments})
        return
    flag = f"--{field.name.replace('_', '-')}"
    arguments["help"] = f"{arguments['help']}{_default_in_words(default, arguments['help'])}"
    if default is REQUIRED:
        parser.add_argument(flag, required=True, **arguments)
    elif default is False:
        parser.add_argument(flag, action="store_true", help=arguments["help"])
    elif field.type in ("bool | None", "bool"):
        action = argparse.BooleanOptionalAction
        parser.add_argument(flag, action=action, default=default, help=arguments["help"])
    else:
        parser.add_argument(flag, default=default, **arguments)


def _default_in_words(default: Any, help: str) -> str:
    if default is REQUIRED or default is None or default is False or "default" in help:
        return ""
    shown = f"{default:g}" if isinstance(default, float) else default
    return f" (default {shown})"
