"""Figures of the study of the forests."""

from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from carillon.files.atomic import atomic_path
from studies.base.colours import COLOURS, MUTED
from studies.base.style import logarithmic, named_rows
from studies.base.table import Row
from studies.blocks.plot import error_over_cost
from studies.forests.results import ForestsStudy

DISTRIBUTIONS = (COLOURS["hcms_ec"], COLOURS["ddfem_hcms_ec"], COLOURS["ddfem_slepc"])
"""Colours of the distributions that forests are scored on."""

PARTS: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("rms_log_solid", "solid", {"linestyle": "-"}),
    ("rms_log_partly_void", "partly void", {"linestyle": "--", "markerfacecolor": "none"}),
)
"""Scores that are drawn: key, label, look."""

SIZED = {"random": "random blocks", "coherent": "blocks of a mesh"}
"""Blocks that forests of growing size are timed on."""


def blocks_figure(study: ForestsStudy) -> Figure:
    """Error over cost of every coarsening, a panel a kind of blocks (Fig. 9)."""
    return error_over_cost(study.result("blocks"))


def curve_figure(study: ForestsStudy) -> Figure:
    """Errors on fresh blocks over the rows trained on."""
    return error_over_rows(study.result("curve"))


def save_curve(rows: Sequence[Row], path: str) -> None:
    """Write a learning curve on white; the ending of `path` decides the format."""
    figure = error_over_rows(rows)
    with atomic_path(path) as temporary:
        figure.savefig(temporary, facecolor="white")
    plt.close(figure)


def error_over_rows(rows: Sequence[Row]) -> Figure:
    """Errors of a learning curve on fresh blocks, both axes logarithmic."""
    figure, axes = plt.subplots(figsize=(7.6, 4.2))
    for distribution, colour in zip(rows[0]["scores"], DISTRIBUTIONS):
        for key, label, look in PARTS:
            values = [row["scores"][distribution][key] for row in rows]
            axes.plot(
                [row["rows"] for row in rows],
                values,
                marker="o",
                markersize=4.5,
                color=colour,
                label=f"{distribution.replace('..', '…')}, {label}",
                **look,
            )
    axes.set_xscale("log")
    logarithmic(axes.yaxis)
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
    logarithmic(axes.xaxis)
    named_rows(axes, names)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.set_xlabel("rms error of log E on fresh blocks")
    figure.legend(loc="outside upper left", ncols=2, columnspacing=1.2)
    return figure


def sizes_figure(study: ForestsStudy) -> Figure:
    """Time of a block over the size of forests."""
    sizes = study.benchmark["sizes"]
    ours = study.benchmark["megabytes"]
    figure, axes = plt.subplots(figsize=(7.6, 3.4))
    for (key, label), colour in zip(SIZED.items(), DISTRIBUTIONS):
        values = [size[key]["median"] for size in sizes]
        megabytes = [size["megabytes"] for size in sizes]
        axes.plot(megabytes, values, "o-", markersize=4.5, color=colour, label=label)
    axes.axvline(
        ours, color=MUTED, linewidth=0.9, linestyle=(0, (4, 2)), label="the forests studied"
    )
    logarithmic(axes.xaxis, axes.yaxis)
    axes.set(xlabel="storage of the forests [MB]", ylabel="time of a block [µs], one core")
    figure.legend(loc="outside upper left", ncols=3, columnspacing=1.2)
    return figure
