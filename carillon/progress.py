"""Progress for people: a bar on a terminal, silence in a log file."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from typing import TypeVar

from tqdm import tqdm

T = TypeVar("T")


def track(
    items: Iterable[T], label: str, total: int | None = None, unit: str = "it", visible: bool = True
) -> Iterator[T]:
    """Iterate over `items`, showing rate and remaining time if standard error is a terminal."""
    show = visible and sys.stderr.isatty()
    yield from tqdm(items, desc=label, total=total, unit=unit, disable=not show, dynamic_ncols=True)


def say(text: str, visible: bool = True, end: str = "\n") -> None:
    """Print one line to standard error; standard output stays free for results.

    With `end="\\r"` the next line takes its place.
    """
    if visible:
        print(text, file=sys.stderr, flush=True, end=end)
