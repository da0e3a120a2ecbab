"""Figures of the study of the forests."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from studies.base.colours import COLOURS, MUTED
from studies.base.entry import Row
from studies.base.style import named_rows, plain_numbers
from studies.forests.results import ForestsStudy
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

DISTRIBUTIONS = (COLOURS["hcms_ec"], COLOURS["ddfem_hcms_ec"], COLOURS["ddfem_slepc"])
"""Colours of the distributions that forests are scored on."""

PARTS = (
    ("rms_log_solid", "solid", {"linestyle": "-"}),
    ("rms_log_partly_void", "partly void", {"linestyle": "--", "markerfacecolor": "none"}),
)
"""Scores that are drawn: key, label, look."""

SIZED = {"random": "random blocks", "coherent": "blocks of a mesh"}
"""Blocks that forests of growing size are timed on."""


def blocks_figure(study: ForestsStudy) -> Figure:
    """Error over cost of every coarsening, a panel a kind of blocks (Fig. 9)."""
    rows = compared(study.result("blocks"))
    kinds = kinds_of(rows)
    marks = _marks(list(dict.fromkeys(map(method_of, rows))))
    figure, axes = plt.subplots(
        -(-len(kinds) // 2), 2, figsize=(7.6, 1.2 + 1.45 * len(kinds)), sharex=True, sharey=True
    )
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
        microseconds = 1e6 * row["seconds_per_block"]
        axis.plot(
            microseconds,
            row["mean_error"],
            marker,
            color=colour,
            markersize=9 if marker == FOREST_MARK[0] else 5.5,
            linestyle="none",
            label=method_of(row),
        )
    least = rows[0]["min_mean_error"]
    axis.axhline(least, color=MUTED, linewidth=0.9, linestyle=(0, (4, 2)), label="least of any")
    axis.set(xscale="log", yscale="log")
    plain_numbers(axis.yaxis)


def curve_figure(study: ForestsStudy) -> Figure:
    """Errors on fresh blocks over the rows trained on."""
    rows = study.result("curve")
    figure, axes = plt.subplots(figsize=(7.6, 4.2))
    for distribution, colour in zip(rows[0]["scores"], DISTRIBUTIONS):
        for key, label, look in PARTS:
            values = [row["scores"][distribution][key] for row in rows]
            axes.loglog(
                [row["rows"] for row in rows],
                values,
                marker="o",
                markersize=4.5,
                color=colour,
                label=f"{distribution.replace('..', '…')}, {label}",
                **look,
            )
    plain_numbers(axes.yaxis)
    axes.set(xlabel="rows trained on", ylabel="rms error of log E on fresh blocks")
    figure.legend(loc="outside upper left", ncols=2, columnspacing=1.2)
    return figure


def variants_figure(study: ForestsStudy) -> Figure:
    """Errors on fresh blocks of every way to train."""
    rows = study.result("variants")
    names = [row["variant"] for row in rows]
    distributions = list(rows[0]["scores"])
    figure, axes = plt.subplots(figsize=(7.6, 1.3 + 0.32 * len(names)))
    for number, (distribution, colour) in enumerate(zip(distributions, DISTRIBUTIONS)):
        shift = (number + 0.5) / len(distributions) - 0.5
        for key, label, look in PARTS:
            axes.plot(
                [row["scores"][distribution][key] for row in rows],
                [position + 0.5 * shift for position in range(len(names))],
                "o",
                markersize=4.5,
                color=colour,
                markerfacecolor=look.get("markerfacecolor", colour),
                label=f"{distribution.replace('..', '…')}, {label}",
            )
    axes.set_xscale("log")
    plain_numbers(axes.xaxis)
    named_rows(axes, names)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.set_xlabel("rms error of log E on fresh blocks")
    figure.legend(loc="outside upper left", ncols=2, columnspacing=1.2)
    return figure


def sizes_figure(study: ForestsStudy) -> Figure:
    """Time of a block over the size of forests."""
    sizes = study.result("benchmark")["sizes"]
    ours = study.result("benchmark")["megabytes"]
    figure, axes = plt.subplots(figsize=(7.6, 3.4))
    for (key, label), colour in zip(SIZED.items(), DISTRIBUTIONS):
        values = [size[key]["median"] for size in sizes]
        megabytes = [size["megabytes"] for size in sizes]
        axes.loglog(megabytes, values, "o-", markersize=4.5, color=colour, label=label)
    axes.axvline(
        ours, color=MUTED, linewidth=0.9, linestyle=(0, (4, 2)), label="the forests studied"
    )
    plain_numbers(axes.xaxis)
    plain_numbers(axes.yaxis)
    axes.set(xlabel="storage of the forests [MB]", ylabel="time of a block [µs], one core")
    figure.legend(loc="outside upper left", ncols=3, columnspacing=1.2)
    return figure
