"""The schema of projects: what its rules say of values, in sentences, and its defaults."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jsonschema import Draft202012Validator

from carillon.errors import UserError
from carillon.files.yaml_input import read_own_yaml

if TYPE_CHECKING:
    from jsonschema.exceptions import ValidationError

SCHEMA = Path(__file__).parent / "project.schema.yaml"
MOST_BITS = 4096
"""Of whole numbers; Python does not write out those of thousands of digits."""
_TYPES = {
    "array": "a list",
    "boolean": "true or false",
    "integer": "a whole number",
    "null": "null",
    "number": "a number",
    "object": "keys and values",
    "string": "a text",
}
_RULES = {
    "minimum": "at least {}",
    "maximum": "at most {}",
    "exclusiveMinimum": "above {}",
    "exclusiveMaximum": "below {}",
    "minItems": "at least {} of them",
    "maxItems": "at most {} of them",
    "minLength": "a text",
    "maxLength": "at most {} characters",
}


@cache
def project_schema() -> dict[str, Any]:
    """The schema of a project."""
    loaded: dict[str, Any] = read_own_yaml(SCHEMA)
    return loaded


def with_defaults(value: Any, schema: Mapping[str, Any]) -> Any:
    """The value, which fits the schema, completed by its defaults."""
    if isinstance(value, list) and "properties" in schema.get("items", {}):
        return [with_defaults(item, schema["items"]) for item in value]
    if "properties" not in schema:
        # A number such as 30.0 is a whole one to the schema.
        whole = isinstance(value, float) and "integer" in schema.get("type", "")
        return int(value) if whole else value
    return {
        key: with_defaults(value.get(key, part.get("default")), part)
        for key, part in schema["properties"].items()
    }


def check(described: Mapping[str, Any], schema: Mapping[str, Any]) -> None:
    """Check that values fit a schema.

    Raises
    ------
    UserError
        With one sentence about the first thing that does not.
    """
    _require_ordinary(described, ())
    mistakes = list(Draft202012Validator(schema).iter_errors(described))
    # A key with a typing error often is also one that is missed: the former says more.
    mistakes.sort(key=lambda mistake: mistake.validator != "additionalProperties")
    if mistakes:
        raise UserError(_sentence(mistakes[0]))


def _require_ordinary(value: Any, path: tuple[str | int, ...]) -> None:
    """Refuse numbers that are not finite, or that cannot even be written in a message."""
    where = f"{_place(path)}: " if path else ""
    if isinstance(value, float) and not math.isfinite(value):
        raise UserError(f"{where}found {value}, expected a finite number")
    if isinstance(value, int) and value.bit_length() > MOST_BITS:
        raise UserError(
            f"{where}found a whole number of {value.bit_length():,} bits, expected {MOST_BITS:,} "
            "at most"
        )
    for key in value if isinstance(value, dict) else ():
        _require_ordinary(key, path)
    parts = value.items() if isinstance(value, dict) else []
    for key, part in enumerate(value) if isinstance(value, list) else parts:
        _require_ordinary(part, (*path, key))


def _sentence(mistake: ValidationError) -> str:
    where = _place(mistake.absolute_path)
    about = f"{where}: " if where else ""
    known = mistake.schema.get("properties", {})
    if mistake.validator == "additionalProperties":
        wrong = next(key for key in mistake.instance if key not in known)
        close = difflib.get_close_matches(str(wrong), known, n=1)
        hint = f"; did you mean {close[0]}?" if close else ""
        return f"{about}there is no key {wrong!r}, only {', '.join(known)}{hint}"
    if mistake.validator == "required":
        key = next(key for key in mistake.validator_value if key not in mistake.instance)
        return f"{about}the key {key} is missing, expected {_meaning(known[key])}"
    meaning = _meaning(mistake.schema)
    return f"{about}found {mistake.instance!r}, expected {_expected(mistake)}: {meaning}"


def _expected(mistake: ValidationError) -> str:
    """What would fit the rule that was broken."""
    value = mistake.validator_value
    word = word_of(mistake.schema)
    if mistake.validator in ("type", "pattern"):
        kinds = mistake.schema["type"]
        named = _TYPES | ({} if word is None else {"string": word})
        return " or ".join(named[kind] for kind in ([kinds] if isinstance(kinds, str) else kinds))
    if mistake.validator == "enum":
        return f"one of {', '.join(value)}"
    bound = _RULES[mistake.validator].format(value)
    return bound if word is None else f"{bound}, or {word}"


def word_of(schema: Mapping[str, Any]) -> str | None:
    """The one word that a key may have in place of a number, if there is one."""
    pattern: str | None = schema.get("pattern")
    return None if pattern is None else pattern.removeprefix("^").removesuffix(r"\Z")


def _meaning(schema: Mapping[str, Any]) -> str:
    """Description of a key, to go on a sentence."""
    text = str(schema["description"])
    return text[0].lower() + text[1:]


def _place(path: Iterable[str | int]) -> str:
    """Name of a value, such as targets[0].clip."""
    parts = [f"[{part}]" if isinstance(part, int) else f".{part}" for part in path]
    return "".join(parts).removeprefix(".")
