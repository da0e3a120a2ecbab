"""Progress for people: a bar on a terminal, a line a minute in a log file."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sized
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from datetime import timedelta
from typing import TypeVar

from tqdm import tqdm

T = TypeVar("T")

LINE_SECONDS = 60.0
"""Time between two lines in a log file; what is over sooner stays silent."""
Watch = Callable[[str, int, int | None], None]
"""Receives the label of what is iterated over, units that are done, and units in all."""
_watch: ContextVar[Watch | None] = ContextVar("watch", default=None)


@contextmanager
def watched(watch: Watch | None) -> Iterator[None]:
    """Call `watch` after each item of every `track` in the context, whether visible or not.

    Examples
    --------
    >>> with watched(lambda label, done, total: print(label, done, "of", total)):
    ...     kept = [name for name in track(["rim", "bow"], "bells", visible=False)]
    bells 1 of 2
    bells 2 of 2
    """
    token = _watch.set(watch)
    try:
        yield
    finally:
        _watch.reset(token)


def track(
    items: Iterable[T],
    label: str,
    total: int | None = None,
    unit: str = "it",
    visible: bool = True,
    weight: Callable[[T], int] | None = None,
    done: int = 0,
) -> Iterator[T]:
    """Iterate over `items`, telling count, rate and remaining time on standard error.

    Parameters
    ----------
    total
        Units in all, those `done` before included; the number of items unless told.
    weight
        Units of an item, one unless told.
    done
        Units that were there before the first item, which do not count for the rate.
    """
    if total is None and isinstance(items, Sized):
        total = len(items)
    watch = _watch.get()
    if watch is not None:
        items = _told(items, watch, label, total, weight, done)
    if not visible:
        yield from items
        return
    shown: tqdm | _LineProgress
    if sys.stderr.isatty():
        shown = tqdm(desc=label, total=total, unit=f" {unit}", initial=done, dynamic_ncols=True)
    else:
        shown = _LineProgress(label, total, unit, done)
    with shown:
        for item in items:
            yield item
            shown.update(1 if weight is None else weight(item))


def _told(
    items: Iterable[T],
    watch: Watch,
    label: str,
    total: int | None,
    weight: Callable[[T], int] | None,
    done: int,
) -> Iterator[T]:
    for item in items:
        yield item
        done += 1 if weight is None else weight(item)
        watch(label, done, total)


class _LineProgress:
    """A line on standard error every `LINE_SECONDS`, in the place of a bar."""

    def __init__(self, label: str, total: int | None, unit: str, done: int) -> None:
        self.label, self.total, self.unit = label, total, unit
        self.before = self.count = done
        self.begin = time.monotonic()
        self.due = self.begin + LINE_SECONDS

    def __enter__(self) -> _LineProgress:
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def update(self, units: int) -> None:
        """Count `units` more; say so if a line is due."""
        self.count += units
        now = time.monotonic()
        if now >= self.due:
            say(self._line(now - self.begin))
            self.due = now + LINE_SECONDS

    def _line(self, seconds: float) -> str:
        rate = (self.count - self.before) / seconds
        of = "" if self.total is None else f" of {self.total:,}"
        line = f"{self.label}: {self.count:,}{of} {self.unit}, {_short(rate)} {self.unit}/s"
        if self.total is not None and rate > 0.0:
            left = timedelta(seconds=round((self.total - self.count) / rate))
            line += f", {left} left"
        return line


def _short(rate: float) -> str:
    return f"{rate:,.0f}" if rate >= 10.0 else f"{rate:.2g}"


def say(text: str, visible: bool = True, end: str = "\n") -> None:
    """Print one line to standard error; standard output stays free for results.

    With `end="\\r"` the next line takes its place.  Work goes on if standard error is gone or full.
    """
    if visible and sys.stderr is not None:
        with suppress(OSError, ValueError):
            # In one piece, so that lines of several ranks do not mix.
            sys.stderr.write(f"{text}{end}")
            sys.stderr.flush()
