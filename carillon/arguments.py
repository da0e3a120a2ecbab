"""Command-line arguments whose mistakes are answered in one sentence."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import NoReturn

from carillon.errors import UserError


class Parser(argparse.ArgumentParser):
    """Argument parser that raises UserError instead of printing its usage."""

    def error(self, message: str) -> NoReturn:
        """Raise the mistake as a UserError; `carillon.cli.run` prints it and exits with 2."""
        raise UserError(f"{message} (see {self.prog} --help)")


def whole_number(least: int) -> Callable[[str], int]:
    """Argument type: an integer that is at least `least`."""

    def convert(text: str) -> int:
        try:
            value = int(text)
        except ValueError:
            raise argparse.ArgumentTypeError(f"{text!r} is not a whole number") from None
        if value < least:
            raise argparse.ArgumentTypeError(f"{value} is too small, expected at least {least}")
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
