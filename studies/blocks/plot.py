"""Picture of Fig. 9: error against cost per block."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from carillon.command_line.outputs import require_plottable
from carillon.files.atomic import atomic_path
from studies.base.colours import COLOURS, MUTED
from studies.base.style import logarithmic
from studies.base.table import Row
from workflow.report.blocks_tables import compared, kind_of, kinds_of, method_of

MARKS: tuple[tuple[str, str], ...] = (
    ("o", COLOURS["hcms"]),
    ("s", COLOURS["hcms"]),
    ("^", COLOURS["ddfem_slepc"]),
    ("D", COLOURS["random"]),
    ("v", COLOURS["random"]),
    ("P", COLOURS["hcms_ec"]),
    ("X", COLOURS["truth"]),
    ("<", COLOURS["ddfem_slepc"]),
)
"""Markers and colours of the coarsenings, in their order; forests have `FOREST_MARK`."""

FOREST_MARK = ("*", COLOURS["ddfem_hcms_ec"])


def plot(rows: Sequence[Row], path: str | Path) -> None:
    """Write the picture on white; the ending of `path` decides the format."""
    path = require_plottable(path)
    figure = error_over_cost(rows)
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=150, facecolor="white")
    plt.close(figure)


def error_over_cost(rows: Sequence[Row]) -> Figure:
    """Mean error under nodal forces over cost, both axes logarithmic, a panel a kind of blocks.

    Kinds that only scale others are left out, as their errors are the same, and so are methods
    beyond the range that they were made for, as their errors are many thousand times larger.
    """
    rows = compared(rows)
    kinds = kinds_of(rows)
    marks = _marks(list(dict.fromkeys(map(method_of, rows))))
    figure, axes = plt.subplots(
        -(-len(kinds) // 2),
        2,
        figsize=(7.6, 1.2 + 1.45 * len(kinds)),
        sharex=True,
        sharey=True,
        squeeze=False,
    )
    for axis in axes.flat[len(kinds) :]:
        axis.set_visible(False)
    for axis, kind in zip(axes.flat, kinds):
        _panel(axis, [row for row in rows if kind_of(row) == kind], marks)
        axis.set_title(kind)
    for axis in axes[-1]:
        axis.set_xlabel("cost per block [µs], one core")
    for axis in axes[:, 0]:
        axis.set_ylabel("E|u_c − u|² / E|u|²")
    handles, labels = axes.flat[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=3, columnspacing=1.2)
    return figure


def _marks(methods: Sequence[str]) -> dict[str, tuple[str, str]]:
    others = iter(MARKS * (1 + len(methods) // len(MARKS)))
    return {name: FOREST_MARK if "forests" in name else next(others) for name in methods}


def _panel(axis: Any, rows: Sequence[Row], marks: dict[str, tuple[str, str]]) -> None:
    for row in rows:
        marker, colour = marks[method_of(row)]
        axis.plot(
            1e6 * row["seconds_per_block"],
            row["mean_error"],
            marker,
            color=colour,
            markersize=9 if marker == FOREST_MARK[0] else 5.5,
            linestyle="none",
            label=method_of(row),
        )
    least = rows[0]["min_mean_error"]
    axis.axhline(least, color=MUTED, linewidth=0.9, linestyle=(0, (4, 2)), label="least of any")
    axis.set_xscale("log")
    logarithmic(axis.yaxis)
