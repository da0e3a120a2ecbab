"""Command-line arguments whose mistakes are answered in one sentence."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Iterable, Sequence
from difflib import get_close_matches
from typing import Any, NoReturn

from carillon.errors import UserError
from carillon.processes.cores import allowed_cores

LARGEST = 2**63 - 1
"""Largest whole number on a command line: what files and compiled code can hold."""

MOST_WORKERS = 64
"""Processes or threads that one command may start on a machine of few cores."""
WORKERS_OF_CORE = 4
"""Processes or threads for each core that one command may start on a machine of many cores."""

ALIKE = 0.7
"""Share of letters in common (difflib) from which a word is taken for a mistyped one."""

_NEGATIVE = re.compile(r"-(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?$", re.ASCII)
_WHOLE = re.compile(r"[-+]?[0-9]{1,30}", re.ASCII)


class Parser(argparse.ArgumentParser):
    """Argument parser that raises UserError instead of printing its usage.

    It takes -1e-3 for a number, as later versions of Python do by themselves, not for an option.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._negative_number_matcher = _NEGATIVE

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse as argparse does, once no option is one that is mistyped."""
        if args is not None and self._subparsers is None:
            self._refuse_mistyped(args)
        return super().parse_known_args(args, namespace)

    def _refuse_mistyped(self, words: Sequence[str]) -> None:
        known = list(self._option_string_actions)
        for word in words:
            if word == "--":
                break
            name = word.partition("=")[0]
            if not name.startswith("--") or any(each.startswith(name) for each in known):
                continue
            if suggestion := alike(name, known):
                self.error(f"no option {name}, did you mean {suggestion}?")

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            suggestion = alike(str(value), map(str, action.choices))
            if suggestion and isinstance(action, argparse._SubParsersAction):
                self.error(f"no command {value!r}, did you mean {suggestion!r}?")
            if suggestion:
                shown = ", ".join(map(repr, action.choices))
                meant = f"did you mean {suggestion!r}? (choose from {shown})"
                raise argparse.ArgumentError(action, f"invalid choice: {value!r}, {meant}")
        super()._check_value(action, value)

    def error(self, message: str) -> NoReturn:
        """Raise the mistake as a UserError; `exit_status.run` prints it and exits with 2."""
        raise UserError(f"{message} (see {self.prog} --help)")


def alike(word: str, words: Iterable[str]) -> str | None:
    """The one of `words` that a mistyped word is most like, if it is like any.

    Examples
    --------
    >>> alike("Validte", ["modes", "validate"]), alike("ring", ["modes", "validate"])
    ('validate', None)
    """
    lower = {each.lower(): each for each in words}
    found = get_close_matches(word.lower(), list(lower), 1, ALIKE)
    return lower[found[0]] if found else None


def whole_number(minimum: int, maximum: int = LARGEST) -> Callable[[str], int]:
    """Argument type: an integer in `minimum`..`maximum`, in digits."""

    def convert(text: str) -> int:
        if not _WHOLE.fullmatch(text):
            raise argparse.ArgumentTypeError(f"{text!r} is not a whole number")
        value = int(text)
        if value < minimum:
            raise argparse.ArgumentTypeError(f"{value} is too small, expected at least {minimum}")
        if value > maximum:
            raise argparse.ArgumentTypeError(f"{value} is too large, expected at most {maximum}")
        return value

    return convert


def number_of_workers(text: str) -> int:
    """Argument type: processes or threads, no more than this machine could bear."""
    return whole_number(1, max(MOST_WORKERS, WORKERS_OF_CORE * allowed_cores()))(text)


def number_between(low: float, high: float, unit: str = "") -> Callable[[str], float]:
    """Argument type: a number in `low`..`high`, both of them included."""

    def convert(text: str) -> float:
        value = _number(text)
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(
                f"{text} is out of range, expected {low:g} to {high:g} {unit}".rstrip()
            )
        return value

    return convert


def positive_number(text: str) -> float:
    """Argument type: a finite number above zero."""
    value = _number(text)
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} is out of range, expected a number above 0")
    return value


def poisson_ratio(text: str) -> float:
    """Argument type: Poisson's ratio in (-1, 0.5)."""
    value = _number(text)
    if not -1.0 < value < 0.5:
        raise argparse.ArgumentTypeError(f"Poisson's ratio {text} is outside (-1, 0.5)")
    return value


def non_negative_number(text: str) -> float:
    """Argument type: a finite number, zero or above."""
    value = _number(text)
    if not 0.0 <= value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} is out of range, expected 0 or above")
    return value


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number") from None
