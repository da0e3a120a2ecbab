"""What the page may call: names and keys, checked before the session sees them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, NoReturn

from carillon.errors import UserError

CALLS: Mapping[str, tuple[str, str]] = {
    "open_mesh": ("mesh", "unit"),
    "open_project": ("project", ""),
    "save": ("name", ""),
    "add_target": ("vertex", "name clip"),
    "change_target": ("target", "vertex name clip modes allow_clipped without"),
    "remove_target": ("target", ""),
    "change_settings": ("settings", ""),
    "optimise": ("", ""),
    "stop": ("", ""),
    "undo": ("", ""),
    "redo": ("", ""),
    "forget_material": ("", ""),
    "fine": ("on", ""),
    "keep": ("", ""),
    "swap": ("", ""),
}
"""Calls by name: keys that have to be there, and keys that may be."""
LONGEST_TEXT = 1000
"""Characters of a key or a text in a call."""


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
    needed, possible = (words.split() for words in CALLS[name])
    for key in needed:
        if key not in arguments:
            raise UserError(f"{name}: lacks {key!r}")
    for key, value in arguments.items():
        if key not in needed and key not in possible:
            raise UserError(
                f"{name}: does not know {key!r:.100}; expected "
                f"{', '.join(needed + possible) or 'nothing'}"
            )
        if isinstance(value, str) and len(value) > LONGEST_TEXT:
            raise UserError(f"{name}: {key} is longer than {LONGEST_TEXT} characters")
    return name, arguments


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"found {name}")
