"""What the page may call: names and keys, checked before the session sees them."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from typing import Any, NoReturn

from carillon.errors import UserError

Kinds = Mapping[str, str]
"""Kinds of the values of a call's keys, by words of `_KINDS`."""

CALLS: Mapping[str, tuple[Kinds, Kinds]] = {
    "open_mesh": ({"mesh": "a text"}, {"unit": "a number"}),
    "open_project": ({"project": "a text"}, {}),
    "save": ({"name": "a text"}, {}),
    "add_target": (
        {"vertex": "a whole number"},
        {"name": "a text or null", "clip": "a text or null"},
    ),
    "change_target": (
        {"target": "a text"},
        {
            "vertex": "a whole number",
            "name": "a text",
            "clip": "a text or null",
            "modes": "a whole number or null",
            "allow_clipped": "true or false",
            "without": "a list of numbers",
        },
    ),
    "remove_target": ({"target": "a text"}, {}),
    "change_settings": ({"settings": "an object"}, {}),
    "optimise": ({}, {}),
    "stop": ({}, {}),
    "undo": ({}, {}),
    "redo": ({}, {}),
    "forget_material": ({}, {}),
    "fine": ({"on": "true or false"}, {}),
    "keep": ({}, {}),
    "swap": ({}, {}),
}
"""Calls by name: keys that have to be there, and keys that may be."""
LARGEST = 2**53
"""Largest whole number in a call; browsers do not tell larger ones apart."""
LONGEST_LIST = 1000
LONGEST_TEXT = 1000
"""Longest key or text of a call in characters."""


def read_message(text: str) -> dict[str, Any]:
    """What a message says.

    Raises
    ------
    UserError
        If it is no JSON, holds numbers that JSON does not have, or is no object.
    """
    try:
        message = json.loads(text, parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as error:
        said = "nested too deeply" if isinstance(error, RecursionError) else str(error)
        raise UserError(f"the message is no JSON ({said}); expected an object") from None
    if not isinstance(message, dict):
        raise UserError('the message is no object; expected {"id": 1, "do": "..."}')
    return message


def read_call(message: Mapping[str, Any]) -> tuple[str, dict[str, Any]]:
    """Name and arguments of a call.

    Raises
    ------
    UserError
        If there is no such call, a key is missing, or there is one that it does not have.
    """
    name = message.get("do")
    if not isinstance(name, str) or name not in CALLS:
        raise UserError(f"there is no call {name!r:.100}; expected one of {', '.join(CALLS)}")
    arguments = {key: value for key, value in message.items() if key not in ("id", "do")}
    needed, possible = CALLS[name]
    kinds = {**needed, **possible}
    for key in needed:
        if key not in arguments:
            raise UserError(f"{name}: lacks {key!r}")
    for key, value in arguments.items():
        if key not in kinds:
            raise UserError(
                f"{name}: does not know {key!r:.100}; expected {', '.join(kinds) or 'nothing'}"
            )
        if not any(_KINDS[word](value) for word in kinds[key].split(" or ")):
            raise UserError(f"{name}: {key} is {value!r:.100}, expected {kinds[key]}")
    return name, arguments


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"found {name}")


def _is_number(value: Any) -> bool:
    return _is_whole(value) or (isinstance(value, float) and math.isfinite(value))


def _is_whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and abs(value) <= LARGEST


def _is_list(value: Any) -> bool:
    return isinstance(value, list) and len(value) <= LONGEST_LIST and all(map(_is_number, value))


_KINDS: Mapping[str, Callable[[Any], bool]] = {
    "a text": lambda value: isinstance(value, str) and len(value) <= LONGEST_TEXT,
    "null": lambda value: value is None,
    "a number": _is_number,
    "a whole number": _is_whole,
    "a list of numbers": _is_list,
    "an object": lambda value: isinstance(value, dict),
    "true": lambda value: value is True,
    "false": lambda value: value is False,
}
