"""Picture of Fig. 9: error against cost per block."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from carillon.command_line.picture_formats import require_plottable
from carillon.files.atomic import atomic_path

MARKERS = "osD^vP*X<>h8"

PANEL_INCHES = (4.2, 3.4)


def _case(row: dict[str, Any]) -> tuple[str, str]:
    low, high = row["range_gpa"]
    return f"{low:g}..{high:g} GPa, {row['distribution']}", row["fill"]


def plot(rows: Sequence[dict[str, Any]], path: str | Path) -> None:
    """Write a panel for each case, mean error under nodal forces over cost, both axes logarithmic.

    Cases that only scale others are left out, as their errors are the same, and so are methods
    beyond the range that they were made for, as their errors are many thousand times larger.
    """
    from matplotlib.figure import Figure  # slow to import, and only needed here
    from matplotlib.ticker import FormatStrFormatter

    path = require_plottable(path)
    shown = [row for row in rows if row["scaled_by"] == 1.0 and not row["clamped"]]
    cases = list(dict.fromkeys(_case(row) for row in shown))
    names = list(dict.fromkeys(row["method"] for row in shown))
    across = min(2, len(cases))
    down = -(-len(cases) // across)
    size = (PANEL_INCHES[0] * across, PANEL_INCHES[1] * down + 0.3 * (len(names) + 2) / 2)
    figure = Figure(figsize=size, layout="constrained")
    axes = figure.subplots(down, across, sharex=True, sharey=True, squeeze=False)
    for axis in axes.flat[len(cases) :]:
        axis.set_visible(False)
    marks = {}
    for axis, case in zip(axes.flat, cases):
        for row in (row for row in shown if _case(row) == case):
            number = names.index(row["method"])
            marks[row["method"]] = axis.scatter(
                1e6 * row["seconds_per_block"],
                row["mean_error"],
                marker=MARKERS[number % len(MARKERS)],
                color=f"C{number % 10}",
                s=60,
                zorder=3,
            )
        minimum = next(row["min_mean_error"] for row in shown if _case(row) == case)
        marks["least of any element"] = axis.axhline(minimum, color="0.4", linestyle="--", zorder=2)
        axis.set(xscale="log", yscale="log", title=", ".join(case))
        axis.yaxis.set_major_formatter(FormatStrFormatter("%g"))
        axis.yaxis.set_minor_formatter(FormatStrFormatter("%g"))
        axis.grid(True, which="both", color="0.9", zorder=0)
    for axis in axes[-1]:
        axis.set_xlabel("cost per block [µs], one core")
    for axis in axes[:, 0]:
        axis.set_ylabel("mean of E|u_c − u|² / E|u|²")
    figure.legend(marks.values(), marks.keys(), loc="outside lower center", ncols=2)
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=150)
