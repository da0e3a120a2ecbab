"""Measured and modelled wall times over the number of ranks, on logarithmic axes."""

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from carillon.files.atomic import atomic_path
from studies.base.colours import INK
from studies.base.results import Results
from studies.base.style import SETTINGS
from studies.scaling.model import MODELLED, kind

COLOURS = dict(
    zip(
        MODELLED,
        ("#6f6a60", "#1f7a6d", "#b8641b", "#8a94a0", "#c9a227", "#7a6a9c", "#3f6fb5", "#b03a5b"),
        strict=True,
    )
)
TITLES = {"strong": "Strong: one solid", "weak": "Weak: unknowns grow with ranks"}
NARROWEST = 7.6
"""Inches that the legend needs."""
SMALLEST = 1e-4
"""Time at which the axis ends [s]."""


def save_plot(result: dict[str, Any], path: str | Path) -> None:
    """Write the plot of a scaling study on white; the ending of `path` decides the format."""
    ending = Path(path).suffix[1:].lower()
    with atomic_path(path) as temporary:
        _figure(result).savefig(temporary, format=ending, dpi=160, facecolor="white")


def scaling_figure(results: Results, model: str) -> Figure:
    """Measured and modelled wall times over the number of ranks, in pages."""
    return _figure(results.read_json(f"models/{model}/scaling.json"))


def _figure(result: dict[str, Any]) -> Figure:
    """Wall time over ranks, a panel for strong and one for weak scaling."""
    shown = [name for name in TITLES if result[name] is not None]
    with plt.rc_context(SETTINGS):
        size = (max(NARROWEST, 4.2 * len(shown)), 4.2)
        figure, axes = plt.subplots(1, len(shown), figsize=size, squeeze=False)
        for axis, name in zip(axes[0], shown, strict=True):
            _draw(axis, result[name])
            axis.set_title(TITLES[name])
        handles, labels = axes[0][0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper left", ncols=5)
    plt.close(figure)
    return figure


def _draw(axis: Any, part: dict[str, Any]) -> None:
    rows = part["model"]["rows"]
    ranks = [row["ranks"] for row in rows]
    axis.plot(ranks, [row["total"] for row in rows], color=INK, linewidth=2.2, label="total")
    for name, colour in COLOURS.items():
        axis.plot(
            ranks,
            [_of_kind(row["seconds"], name) for row in rows],
            color=colour,
            linewidth=1.2,
            label=name,
        )
    for run in part["runs"]:
        slowest = {phase: max(tallies["seconds"]) for phase, tallies in run["phases"].items()}
        _dot(axis, run, run["seconds"], INK)
        for name, colour in COLOURS.items():
            _dot(axis, run, _of_kind(slowest, name), colour)
    axis.set_xscale("log", base=2)
    axis.set_yscale("log")
    axis.set_ylim(bottom=SMALLEST)
    axis.set_xlabel("ranks")
    axis.set_ylabel("wall time [s]")
    axis.grid(alpha=0.3)


def _dot(axis: Any, run: dict[str, Any], seconds: float, colour: str) -> None:
    filled = "none" if run["oversubscribed"] else colour
    axis.plot(run["ranks"], seconds, "o", markersize=5, color=colour, markerfacecolor=filled)


def _of_kind(seconds: dict[str, float], name: str) -> float:
    """Seconds of a kind of phases; nothing to draw if there are none."""
    return sum(time for phase, time in seconds.items() if kind(phase) == name) or float("nan")
