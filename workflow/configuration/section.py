"""Texts and lists that sections of the configuration hold, and checks across sections."""

import shlex
import unicodedata
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, TypeVar

from annotated_types import Ge, Gt, Le, MaxLen, MinLen

from carillon.files.paths import LONGEST_NAME
from carillon.parameters import Check
from carillon.parameters.sentences import ParameterError

LONGEST_PATH = 1000
"""Longest path in bytes; most systems take 4,096, of which results need some."""
PLACEHOLDERS = "{}<>"
"""Characters that Snakemake takes for the begin and end of a placeholder."""


def _line(text: str) -> str:
    if {"Cc", "Cs", "Zl", "Zp"} & set(map(unicodedata.category, text)):
        raise ValueError(f"{text!r} has a line break, a control character or half a character")
    return text


def _path(text: str) -> str:
    _line(text)
    if any(character in PLACEHOLDERS for character in text):
        listed = " ".join(PLACEHOLDERS)
        raise ValueError(f"{text!r} has one of {listed}, which stand for placeholders")
    if len(text.encode()) > LONGEST_PATH:
        raise ValueError(f"{text!r} is longer than {LONGEST_PATH:,} bytes")
    if any(len(name.encode()) > LONGEST_NAME for name in text.split("/")):
        raise ValueError(f"{text!r} has a name of more than {LONGEST_NAME} bytes")
    return text


def _results(text: str) -> str:
    # Snakemake drops the `./` that a hyphen needs in front.
    if str(Path(text)).startswith("-"):
        raise ValueError(f"{text!r} begins with a hyphen")
    return text


def _command(text: str) -> str:
    _line(text)
    try:
        words = shlex.split(text)
    except ValueError as error:
        raise ValueError(f"{text!r} is no command ({error})") from None
    if not words:
        raise ValueError(f"{text!r} names no command")
    return text


Item = TypeVar("Item")


def _unique(values: tuple[Item, ...]) -> tuple[Item, ...]:
    if len(set(map(repr, values))) < len(values):
        raise ValueError(f"{list(values)!r} has an entry twice")
    return values


Line = Annotated[str, Check(_line)]
"""Text that pages, tables, logs and terminals show in one line."""
Title = Annotated[str, MaxLen(200), Check(_line)]
Folder = Annotated[str, Check(_path)]
"""Path that file systems, Snakemake and commands understand alike; may be empty."""
File = Annotated[str, MinLen(1), Check(_path)]
ResultsFolder = Annotated[File, Check(_results)]
CommandLine = Annotated[str, MinLen(1), MaxLen(1000), Check(_command)]
"""Command without line breaks whose quotations end."""
Distinct = Annotated[tuple[Item, ...], Check(_unique)]
"""Values that differ; there may be none."""
Several = Annotated[tuple[Item, ...], MinLen(1), Check(_unique)]
"""Values that differ, one at least."""
Share = Annotated[float, Gt(0), Le(1)]
RelativeError = Annotated[float, Gt(0), Le(1e3)]
Seconds = Annotated[float, Gt(0), Le(1e7)]
Runs = Annotated[int, Ge(1), Le(1000)]
Ranks = Annotated[int, Ge(1), Le(4096)]
RankCounts = Several[Annotated[int, Ge(1), Le(1024)]]


def require_named(key: str, names: Iterable[str], models: Iterable[str]) -> None:
    """Check that all names in a list are those of models.

    Raises
    ------
    ParameterError
        At the key of the list, if one is not.
    """
    known = list(models)
    for name in names:
        if name not in known:
            raise ParameterError((key,), f"{name!r} is not among the models {', '.join(known)}")
