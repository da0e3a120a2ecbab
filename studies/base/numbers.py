"""Numbers as people read them: few digits, units beside, powers of ten spelt as such."""

import math
from collections.abc import Callable
from typing import Any

MISSING = "–"
ROUNDING = 1e-9
"""Relative errors below this are not told apart: the eigensolvers' tolerances are no smaller."""
_SUPERSCRIPTS = dict(zip(map(ord, "-0123456789"), "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def show(value: Any, kind: str = "text") -> str:
    """Format `value` by the kind of its column.

    Kinds of errors: `percent` (of a fraction), `fraction`, `small` (also residuals), `angle` (of
    radians). Others: `text`, `count`, `hertz`, `seconds`, `modelled` (seconds that nobody
    measured), `misfit` (of these, a fraction), `times` (a ratio, the more the better), `score` (a
    fraction, likewise), `share` (per
    cent that are neither good nor bad), `bytes`, `range` (of GPa).

    Examples
    --------
    >>> show(0.0312, "percent"), show(3.1e-9, "percent"), show(12345, "count")
    ('3.1 %', '3.1·10⁻⁷ %', '12,345')
    >>> show(4.56e-12, "small"), show(0.00123, "seconds"), show(123.4, "seconds")
    ('4.6·10⁻¹²', '0.0012 s', '123 s')
    """
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return MISSING
    text = KINDS[kind](value)
    return text if kind == "text" else text.replace("-", "−")


def _percent(fraction: float) -> str:
    if 0 < abs(fraction) < ROUNDING:
        return f"< {_power(100.0 * ROUNDING)} %"
    percent = 100.0 * fraction
    if abs(percent) < 0.001:
        return f"{_power(percent)} %"
    return f"{_digits(percent, 2)} %"


def _small(value: float) -> str:
    return _digits(value, 2) if 0.01 <= abs(value) < 100 else _power(value)


def _seconds(value: float) -> str:
    if 0 < abs(value) < 1e-3:
        return f"{_digits(1e6 * value, 2)} µs"
    return f"{_digits(value, 3 if value >= 1 else 2)} s"


def _angle(radians: float) -> str:
    degrees = math.degrees(radians)
    return f"{_digits(degrees, 2)}°" if degrees >= 1e-3 else "< 0.001°"


def _bytes(value: float) -> str:
    if value < 1e6:
        return f"{_digits(value / 1e3, 3)} kB" if value else "0"
    return f"{_digits(value / 1e6, 3)} MB" if value < 1e9 else f"{_digits(value / 1e9, 3)} GB"


def _digits(value: float, digits: int) -> str:
    """At least `digits` significant digits, never an exponent."""
    if value == 0:
        return "0"
    value = float(f"{value:.{digits - 1}e}") if abs(value) < 10**digits else value
    after_point = digits - 1 - math.floor(math.log10(abs(value)))
    return f"{value:,.{max(0, after_point)}f}"


def _power(value: float) -> str:
    if value == 0:
        return "0"
    mantissa, exponent = f"{value:.1e}".split("e")
    power = f"10{str(int(exponent)).translate(_SUPERSCRIPTS)}"
    return power if mantissa == "1.0" else f"{mantissa}·{power}"


KINDS: dict[str, Callable[[Any], str]] = {
    "text": str,
    "count": lambda value: f"{int(value):,}",
    "hertz": lambda value: _digits(value, 5),
    "percent": _percent,
    "seconds": _seconds,
    "times": lambda value: f"{_digits(value, 2)}×",
    "small": _small,
    "angle": _angle,
    "modelled": _seconds,
    "misfit": _percent,
    "share": _percent,
    "score": lambda value: _digits(value, 3),
    "bytes": _bytes,
    "fraction": lambda value: _digits(value, 3),
    "range": lambda value: f"{value[0]:,.0f}…{value[1]:,.0f}",
}
"""How values of each kind are written."""
