"""Command lines made from dataclasses of parameters."""

import argparse
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, TypeVar

from carillon.errors import on_all_ranks
from carillon.parameters.fields import Parameter, ValueDomain, domain_of, parameters_of
from carillon.parameters.model import REQUIRED, adapter

T = TypeVar("T")

_WHOLE = re.compile(r"[-+]?[0-9]{1,30}", re.ASCII)


def add_options(
    parser: argparse._ActionsContainer,
    model: type,
    leave_out: Sequence[str] = (),
    positional: Sequence[str] = (),
) -> None:
    """Add the options of a dataclass of parameters to a command line.

    Parameters
    ----------
    parser
        The command line, or a group of it.
    model
        A dataclass; its fields without a meaning are left alone.
    leave_out
        Names of fields that are no options of this command.
    positional
        Names of fields that are given by their place.
    """
    for each in parameters_of(model).values():
        if each.meaning and each.name not in leave_out:
            _add(parser, each, each.name in positional)


@on_all_ranks()
def collect(model: type[T], arguments: argparse.Namespace) -> T:
    """The dataclass from what a command line gave, its defaults for what the command leaves out."""
    known = parameters_of(model)  # type: ignore[arg-type]
    return model(**{name: value for name, value in vars(arguments).items() if name in known})


def reader(annotation: Any) -> Callable[[str], Any]:
    """Argument type: a word that an annotation such as `Resolution` admits."""
    return _reader(domain_of(annotation))


def _add(parser: argparse._ActionsContainer, each: Parameter, positional: bool) -> None:
    domain, default = each.domain, each.default
    arguments: dict[str, Any] = {"help": each.meaning}
    if each.metavar is not None:
        arguments["metavar"] = each.metavar
    item = domain
    if each.several:
        arguments["nargs"] = "+"
    elif domain.kind is tuple and each.read is None:
        item = replace(domain.items[0], meaning=domain.items[0].meaning or each.meaning)
        arguments["nargs"] = "+" if domain.endless else len(domain.items)
    if item.choices and not each.read:
        arguments["choices"] = item.choices
    elif each.read or item.kind is not str or item.limits:
        arguments["type"] = _checked(each.read) if each.read else _reader(item)
    if positional and default is not REQUIRED:
        arguments.setdefault("nargs", "?")
    if positional:
        parser.add_argument(each.name, **{"metavar": each.name.upper(), **arguments})
        return
    flag = f"--{each.name.replace('_', '-')}"
    arguments["help"] += _default_in_words(default, each.meaning)
    if default is REQUIRED:
        parser.add_argument(flag, required=True, **arguments)
    elif domain.kind is not bool:
        parser.add_argument(flag, default=default, **arguments)
    elif default is False:
        parser.add_argument(flag, action="store_true", help=arguments["help"])
    else:
        action = argparse.BooleanOptionalAction
        parser.add_argument(flag, action=action, default=default, help=arguments["help"])


def _reader(domain: ValueDomain) -> Callable[[str], Any]:
    domain = replace(domain, nullable=False)

    def read(text: str) -> Any:
        from pydantic import ValidationError

        from carillon.parameters.sentences import mistake_of

        value = _number(text, domain.kind)
        try:
            return adapter(domain.annotation).validate_python(value, strict=True)
        except ValidationError as error:
            raise argparse.ArgumentTypeError(mistake_of(error, domain).reason) from None

    return read


def _checked(read: Callable[[str], Any]) -> Callable[[str], Any]:
    def checked(text: str) -> Any:
        try:
            return read(text)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    return checked


def _number(text: str, kind: Any) -> Any:
    """The number that a word is, if it is one; the word otherwise."""
    if kind is int:
        return int(text) if _WHOLE.fullmatch(text) else text
    try:
        return float(text) if kind is float else text
    except ValueError:
        return text


def _default_in_words(default: Any, help: str) -> str:
    if default is REQUIRED or default is None or default is False or "default" in help:
        return ""
    shown = f"{default:g}" if isinstance(default, float) else default
    return f" (default {shown})"
