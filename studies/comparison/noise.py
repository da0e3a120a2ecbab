"""When a number moved beyond noise, and whether for the better: a rule for every kind of number."""

import math
from functools import partial
from typing import Any, NamedTuple

from studies.base.numbers import show

SAME, CHANGED, GONE, NEW = "same", "changed", "gone", "new"
FASTER, SLOWER = "faster", "slower"
MORE_ACCURATE, LESS_ACCURATE = "more accurate", "less accurate"
SMALLER, LARGER = "smaller", "larger"

WORSE = (SLOWER, LESS_ACCURATE, LARGER)
BETTER = (FASTER, MORE_ACCURATE, SMALLER)
OTHER = (CHANGED, GONE, NEW)
VERDICTS = (*WORSE, *BETTER, *OTHER)
"""Verdicts on numbers that moved, the worst first."""

TIME_TOLERANCE = 0.1
"""Least relative move of a time whose spread is known."""
SINGLE_TOLERANCE, SINGLE_SECONDS = 0.5, 0.2
"""Least relative and absolute [s] move of a time that was measured once."""
ERROR_TOLERANCE = 0.01
"""Least relative move of an error."""
TINY_ERROR, TINY_FACTOR = 1e-4, 3.0
"""Errors below the first are what an iteration stopped at, and move by the second at least."""
ROUNDING = 1e-9
"""Errors below this are rounding."""
BYTES_TOLERANCE = 0.1
"""Least relative move of storage or memory."""
VALUE_TOLERANCE = 1e-4
"""Least relative move of a frequency or a share."""

ERRORS = ("percent", "fraction", "small", "angle")
SAYINGS = {
    "seconds": (SLOWER, FASTER),
    "times": (FASTER, SLOWER),
    **dict.fromkeys(ERRORS, (LESS_ACCURATE, MORE_ACCURATE)),
    "score": (MORE_ACCURATE, LESS_ACCURATE),
    "bytes": (LARGER, SMALLER),
}
"""Words for a number that moved up and for one that moved down, by its kind."""
UNJUDGED = ("modelled", "misfit")
"""Kinds of numbers that are not compared."""

_percent, _power = partial(show, kind="percent"), partial(show, kind="small")

RULES = {
    "times and speed-ups of several runs": "moved when their spreads, from minimum to "
    f"maximum, do not overlap and they differ by more than {_percent(TIME_TOLERANCE)}",
    "times of one run": f"moved by more than {_percent(SINGLE_TOLERANCE)} and {SINGLE_SECONDS:g} s",
    "errors": f"moved by more than {_percent(ERROR_TOLERANCE)}; where both are below "
    f"{_power(TINY_ERROR)}, at which iterations stop, by more than a factor of {TINY_FACTOR:g}; "
    f"below {_power(ROUNDING)} they are rounding",
    "scores, such as R²": "moved when what they lack to 1 did, by the rule for errors",
    "storage and memory": f"moved by more than {_percent(BYTES_TOLERANCE)}",
    "frequencies and shares": f"changed by more than {_power(VALUE_TOLERANCE)} of their value; "
    "neither is better",
    "counts and texts": "changed at all; neither is better",
    "speed-ups of one run, modelled times, misfits": "are not judged, as the times themselves are",
}
"""The rules in words."""


class Value(NamedTuple):
    """A number or text, and the spread of its runs if there were several."""

    value: Any
    min: float | None = None
    max: float | None = None

    @property
    def spread(self) -> tuple[float, float] | None:
        """Minimum and maximum of several runs; None if there was one."""
        if self.min is None or self.max is None or self.min == self.max:
            return None
        return self.min, self.max


def verdict(kind: str, before: Value, now: Value) -> str:
    """What became of the baseline's number of a kind, see `studies.base.numbers.show`."""
    old, new = before.value, now.value
    if old is None or new is None:
        return SAME if old is new else GONE if new is None else NEW
    if isinstance(old, str) or isinstance(new, str) or kind == "count":
        return SAME if old == new else CHANGED
    if math.isnan(old) or math.isnan(new):
        return SAME if math.isnan(old) and math.isnan(new) else CHANGED
    if kind in ("seconds", "times"):
        moved = _time_moved(kind, before, now)
    elif kind in ERRORS:
        old, new = abs(old), abs(new)
        moved = _error_moved(old, new)
    elif kind == "score":
        moved = _error_moved(1.0 - old, 1.0 - new)
    else:
        moved = _excess(old, new) > (BYTES_TOLERANCE if kind == "bytes" else VALUE_TOLERANCE)
    larger, smaller = SAYINGS.get(kind, (CHANGED, CHANGED))
    return SAME if not moved else larger if new > old else smaller


def _time_moved(kind: str, before: Value, now: Value) -> bool:
    excess = _excess(before.value, now.value)
    if before.spread and now.spread:
        apart = before.spread[1] < now.spread[0] or now.spread[1] < before.spread[0]
        return apart and excess > TIME_TOLERANCE
    far = kind == "seconds" and abs(now.value - before.value) > SINGLE_SECONDS
    return far and excess > SINGLE_TOLERANCE


def _error_moved(old: float, new: float) -> bool:
    small, large = sorted((abs(old), abs(new)))
    if large < TINY_ERROR:
        return large > TINY_FACTOR * max(small, ROUNDING)
    return _excess(small, large) > ERROR_TOLERANCE


def _excess(one: float, other: float) -> float:
    """How much larger the larger of two magnitudes is, relative to the smaller."""
    small, large = sorted((abs(one), abs(other)))
    if small == 0.0:
        return math.inf if large else 0.0
    return large / small - 1.0
