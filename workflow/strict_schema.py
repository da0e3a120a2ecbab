"""JSON schemas as the workflow means them: finite numbers, and texts fit for files and commands."""

from __future__ import annotations

import math
import unicodedata
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from jsonschema import Draft202012Validator, FormatChecker
from jsonschema.exceptions import ValidationError, best_match
from jsonschema.validators import extend

from carillon.files.paths import LONGEST_NAME
from workflow.arguments import quoted

LONGEST_PATH = 1000
"""Bytes of a path; most systems take 4,096, of which results need some."""
PLACEHOLDERS = "{}<>"
"""Characters that Snakemake takes for the begin and end of a placeholder."""

_FORMATS = FormatChecker(formats=())


def first_mistake(schema: Mapping[str, Any], values: Any) -> ValidationError | None:
    """The most telling violation of a schema, if there is one.

    Other than JSON schema itself: numbers are finite, an integer has no point, and the formats
    `line`, `path`, `results` and `command` are checked.
    """
    return best_match(_Validator(schema, format_checker=_FORMATS).iter_errors(values))


def reason(mistake: ValidationError) -> str:
    """What is wrong, in words."""
    return f"{mistake.instance!r} {mistake.cause}" if mistake.cause else mistake.message


def _is_integer(_: Any, value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _is_number(checker: Any, value: Any) -> bool:
    return _is_integer(checker, value) or (isinstance(value, float) and math.isfinite(value))


def _unique(_: Any, unique: bool, values: Any, schema: Any) -> Iterator[ValidationError]:
    """As in JSON schema, where the library needs the square of the time."""
    if unique and isinstance(values, list) and len(set(map(repr, values))) < len(values):
        yield ValidationError(f"{values!r} has an entry twice")


_Validator = extend(
    Draft202012Validator,
    {"uniqueItems": _unique},
    type_checker=Draft202012Validator.TYPE_CHECKER.redefine_many(
        {"integer": _is_integer, "number": _is_number}
    ),
)


@_FORMATS.checks("line", raises=ValueError)
def _is_line(value: Any) -> bool:
    """Text that pages, tables, logs and terminals can show in one line."""
    kinds = set(map(unicodedata.category, value)) if isinstance(value, str) else set()
    if kinds & {"Cc", "Cs", "Zl", "Zp"}:
        raise ValueError("has a line break, a control character or half a character")
    return True


@_FORMATS.checks("path", raises=ValueError)
def _is_path(value: Any) -> bool:
    """Path of a file or folder that file systems, Snakemake and commands understand alike."""
    if not isinstance(value, str):
        return True
    _is_line(value)
    if any(character in PLACEHOLDERS for character in value):
        raise ValueError(f"has one of {' '.join(PLACEHOLDERS)}, which stand for placeholders")
    if len(value.encode()) > LONGEST_PATH:
        raise ValueError(f"is longer than {LONGEST_PATH:,} bytes")
    if any(len(name.encode()) > LONGEST_NAME for name in value.split("/")):
        raise ValueError(f"has a name of more than {LONGEST_NAME} bytes")
    return True


@_FORMATS.checks("results", raises=ValueError)
def _is_results(value: Any) -> bool:
    """Path that Snakemake can make files below; it drops the `./` that a hyphen needs in front."""
    if isinstance(value, str) and str(Path(value)).startswith("-"):
        raise ValueError("begins with a hyphen")
    return _is_path(value)


@_FORMATS.checks("command", raises=ValueError)
def _is_command(value: Any) -> bool:
    """Command line without line breaks whose quotations end."""
    if not isinstance(value, str):
        return True
    _is_line(value)
    if not quoted(value):
        raise ValueError("names no command")
    return True
