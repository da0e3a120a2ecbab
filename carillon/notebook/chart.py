"""Small charts as SVG, a few kilobytes each, in the colour of the text around them.

They are drawn here, not by matplotlib: that is no requirement of the solver, takes a second to
load, and its pictures keep their white ground in a dark notebook.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from carillon.arrays import Array
from carillon.notebook.card import Markup

WIDTH, HEIGHT = 340, 190
LEFT, RIGHT, TOP, BOTTOM = 58, 22, 10, 38
"""Size of a chart and its margins [px]."""
MOST_STEMS = 300
"""Stems, or columns of a waveform, that a chart has at most."""


@dataclass(frozen=True)
class Axis:
    """Label of an axis, and its range."""

    label: str
    low: float
    high: float
    is_log: bool = False

    def share(self, values: Array) -> Array:
        """Places (n,) of values (n,), 0 at the low end and 1 at the high one."""
        low, high, values = self.low, self.high, np.asarray(values, dtype=float)
        if self.is_log:
            low, high, values = np.log10(low), np.log10(high), np.log10(np.maximum(values, low))
        return np.clip((values - low) / ((high - low) or 1.0), 0.0, 1.0)

    def ticks(self) -> list[float]:
        """Three to five round values in the range."""
        if self.is_log:
            first, last = np.ceil(np.log10(self.low)), np.floor(np.log10(self.high))
            step = max(1, round((last - first) / 4))
            return [10.0**power for power in np.arange(first, last + 0.5, step)]
        rough = (self.high - self.low) / 4.0 or 1.0
        unit = 10.0 ** np.floor(np.log10(rough))
        step = unit * min((1.0, 2.0, 5.0, 10.0), key=lambda each: abs(each * unit - rough))
        values = np.arange(np.ceil(self.low / step), np.floor(self.high / step + 1e-9) + 0.5)
        return [float(each * step) for each in values]


def stems(x: Axis, y: Axis, values: Array, heights: Array) -> Markup:
    """A line from below up to each point: values (n,) along x, heights (n,) along y."""
    across, up = _places(x, y, values[:MOST_STEMS], heights[:MOST_STEMS])
    floor = HEIGHT - BOTTOM
    lines = "".join(f"M{a:.1f} {floor}V{b:.1f}" for a, b in zip(across, up))
    dots = "".join(f'<circle cx="{a:.1f}" cy="{b:.1f}" r="2.2"/>' for a, b in zip(across, up))
    drawn = f'<path d="{lines}" stroke-opacity=".45"/><g fill="currentColor">{dots}</g>'
    return _framed(x, y, drawn)


def waveform(samples: Array, rate: int) -> Markup:
    """Lowest and highest of samples (s,) in each of some columns, over time [s]."""
    count = min(MOST_STEMS, len(samples))
    columns = np.array_split(samples, count)
    low = np.array([column.min() for column in columns])
    high = np.array([column.max() for column in columns])
    largest = float(max(np.abs(low).max(), np.abs(high).max())) or 1.0
    x, y = Axis("time [s]", 0.0, len(samples) / rate), Axis("full scale", -largest, largest)
    middles = (np.arange(count) + 0.5) / count * x.high
    across, below = _places(x, y, middles, low)
    above = _places(x, y, middles, high)[1]
    # A line of silence is seen, too.
    lines = "".join(
        f"M{a:.1f} {b + 0.4:.1f}V{c - 0.4:.1f}" for a, b, c in zip(across, below, above)
    )
    return _framed(x, y, f'<path d="{lines}"/>')


def _places(x: Axis, y: Axis, values: Array, heights: Array) -> tuple[Array, Array]:
    """Pixels (n,) from the left and from the top."""
    wide, high = WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM
    return LEFT + wide * x.share(values), HEIGHT - BOTTOM - high * y.share(heights)


def _framed(x: Axis, y: Axis, drawn: str) -> Markup:
    floor, ceiling = HEIGHT - BOTTOM, TOP
    marks, texts = [f"M{LEFT} {ceiling}V{floor}H{WIDTH - RIGHT}"], []
    ticks = x.ticks()
    for value, across in zip(ticks, _places(x, y, np.array(ticks), np.array(ticks))[0]):
        marks.append(f"M{across:.1f} {floor}v4")
        texts.append(_text(across, floor + 16, _number(value), "middle"))
    ticks = y.ticks()
    for value, down in zip(ticks, _places(x, y, np.array(ticks), np.array(ticks))[1]):
        marks.append(f"M{LEFT} {down:.1f}h-4")
        texts.append(_text(LEFT - 7, down + 4, _number(value), "end"))
    middle = (LEFT + WIDTH - RIGHT) / 2
    texts.append(_text(middle, HEIGHT - 4, x.label, "middle"))
    turned = f' transform="rotate(-90 12 {(floor + ceiling) / 2})"'
    texts.append(_text(12, (floor + ceiling) / 2, y.label, "middle", turned))
    label = escape(f"{y.label} over {x.label}")
    return Markup(
        f'<svg role="img" aria-label="{label}" width="{WIDTH}" height="{HEIGHT}" '
        f'viewBox="0 0 {WIDTH} {HEIGHT}" font-size="11" fill="none" stroke="currentColor">'
        f'<path d="{"".join(marks)}"/>{drawn}<g fill="currentColor" stroke="none">'
        f"{''.join(texts)}</g></svg>"
    )


def _text(across: float, down: float, text: str, anchor: str, more: str = "") -> str:
    return (
        f'<text x="{across:.1f}" y="{down:.1f}" text-anchor="{anchor}"{more}>{escape(text)}</text>'
    )


def _number(value: float) -> str:
    """A number of an axis, in few characters."""
    return f"{value:.0e}".replace("e-0", "e-") if 0.0 < abs(value) < 1e-3 else f"{value:g}"


def range_of(values: Sequence[float] | Array) -> tuple[float, float]:
    """Least and greatest of the values that are finite; 0 and 1 if none is."""
    finite = np.asarray(values, dtype=float)
    finite = finite[np.isfinite(finite)]
    return (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
