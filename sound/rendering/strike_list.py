"""Lists of strikes: tables (CSV) of times, places and impulses."""

import csv
import io
from collections.abc import Callable, Mapping
from math import isfinite
from pathlib import Path
from typing import NamedTuple

from carillon.errors import UserError
from carillon.files.paths import cause, require_file
from sound.bounds import LARGEST_IMPULSE, LEAST_IMPULSE, LONGEST_SOUND

MOST_STRIKES = 10_000
"""Greatest number of strikes in a list."""
MOST_BYTES = 1 << 22
"""Greatest size of a list's file [bytes]."""
FARTHEST = 1e9
"""Greatest magnitude of a coordinate."""
TIME, TARGET, VERTEX, STRENGTH = "time_seconds", "target", "vertex", "strength_newton_seconds"
AT = ("x", "y", "z")
COLUMNS = (TIME, TARGET, VERTEX, *AT, STRENGTH)
"""Columns of a list, in any order; all but the time may be left out."""


class Point(NamedTuple):
    """A struck point: one of a target's name, a vertex, and a position (3,).

    Positions are in the mesh's own coordinates; for modes of no design, in metres.
    """

    target: str | None = None
    vertex: int | None = None
    at: tuple[float, float, float] | None = None


class ListedStrike(NamedTuple):
    """A line of a list: its number, time [s], point, and impulse [N s] if it names one."""

    line: int
    seconds: float
    point: Point
    strength: float | None


def read_strikes(path: str | Path) -> list[ListedStrike]:
    """Read a list of strikes.

    The first line names the columns, see `COLUMNS`. Every other line has a time and one place.
    Raises UserError if the file is missing, no table, too long or empty, or a line of it is wrong,
    which is named by its number.
    """
    text = _text(require_file(path, "a list of strikes (CSV)"))
    reader = csv.reader(io.StringIO(text, newline=""), strict=True, skipinitialspace=True)
    strikes: list[ListedStrike] = []
    names: list[str] | None = None
    try:
        for fields in reader:
            cells = [field.strip() for field in fields]
            if not any(cells):
                continue
            if names is None:
                names = cells
                _check_header(names)
            elif len(strikes) == MOST_STRIKES:
                raise UserError(f"more than {MOST_STRIKES:,} strikes; render them in parts")
            else:
                strikes.append(_strike(reader.line_num, names, cells))
    except (UserError, csv.Error) as error:
        raise UserError(f"{path}, line {reader.line_num}: {error}") from None
    if not strikes:
        raise UserError(
            f"{path}: has no strikes, expected a line that names columns ({', '.join(COLUMNS)}) "
            "and a line for every strike"
        )
    return strikes


def _text(path: Path) -> str:
    try:
        with open(path, "rb") as file:
            content = file.read(MOST_BYTES + 1)
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({cause(error)})") from None
    if len(content) > MOST_BYTES:
        raise UserError(
            f"{path}: longer than {MOST_BYTES:,} bytes, expected a list of strikes (CSV)"
        )
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise UserError(
            f"{path}: is no text ({error.reason}), expected a list of strikes (CSV)"
        ) from None


def _check_header(names: list[str]) -> None:
    unknown = [name for name in names if name not in COLUMNS]
    if unknown:
        raise UserError(
            f"found the column {unknown[0][:40]!r}, expected some of {', '.join(COLUMNS)}; name "
            "the columns in the first line"
        )
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise UserError(f"the column {twice} is there twice; leave one of them out")
    if TIME not in names:
        raise UserError(f"there is no column {TIME}; add the time of every strike")


def _strike(line: int, names: list[str], cells: list[str]) -> ListedStrike:
    if len(cells) != len(names):
        raise UserError(f"found {len(cells)} values, expected {len(names)}, one for every column")
    row = {name: cell for name, cell in zip(names, cells) if cell}
    if TIME not in row:
        raise UserError(f"expected a number in the column {TIME}, found nothing")
    seconds = _number(row, TIME, 0.0, LONGEST_SOUND)
    strength = _number(row, STRENGTH, LEAST_IMPULSE, LARGEST_IMPULSE) if STRENGTH in row else None
    return ListedStrike(line, seconds, _point(row), strength)


def _point(row: Mapping[str, str]) -> Point:
    coordinates = [name for name in AT if name in row]
    given = [name for name in (TARGET, VERTEX) if name in row] + [", ".join(AT)] * bool(coordinates)
    if len(given) != 1:
        places = " and ".join(given) or "nothing"
        raise UserError(
            f"expected one place, in {TARGET}, in {VERTEX} or in {', '.join(AT)}; found {places}"
        )
    if TARGET in row:
        return Point(target=row[TARGET])
    if VERTEX in row:
        return Point(vertex=int(_number(row, VERTEX, 0, FARTHEST, int)))
    if len(coordinates) < len(AT):
        raise UserError(
            f"expected numbers in all of {', '.join(AT)}, found {', '.join(coordinates)}"
        )
    x, y, z = (_number(row, name, -FARTHEST, FARTHEST) for name in AT)
    return Point(at=(x, y, z))


def _number(
    row: Mapping[str, str],
    name: str,
    least: float,
    most: float,
    kind: Callable[[str], float] = float,
) -> float:
    try:
        value = kind(row[name])
    except ValueError:
        value = float("nan")
    if not isfinite(value) or not least <= value <= most:
        what = "a whole number" if kind is int else "a number"
        raise UserError(f"{name}: found {row[name][:40]!r}, expected {what}, {least:g} to {most:g}")
    return value
