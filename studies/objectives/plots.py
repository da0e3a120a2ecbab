"""Figures of the study."""

from typing import Any

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from studies.base.colours import COLOURS, FAINT, MUTED
from studies.base.style import logarithmic, named_rows
from studies.objectives.goals import rms_limits
from studies.objectives.results import Objectives

MATERIALS: dict[str, tuple[str, str]] = {
    "uniform": ("o", COLOURS["hcms"]),
    "smooth": ("s", COLOURS["hcms_ec"]),
    "two-region": ("^", COLOURS["ddfem_slepc"]),
    "noise": ("D", COLOURS["ddfem_hcms_ec"]),
    "random": ("v", COLOURS["random"]),
}
"""Marker and colour of each material."""


def errors_figure(study: Objectives, solid: str) -> Figure:
    """The rms frequency errors of one solid by objective, a marker a material and resolution.

    Limits that an objective should stay below on this solid are drawn as lines.
    """
    limits = rms_limits(study, solid)
    rows = [row for row in study.table("errors").rows if row["model"] == solid]
    names = list(dict.fromkeys(row["coarsening"] for row in rows))
    finest = max(row["resolution"] for row in rows)
    materials = list(dict.fromkeys(row["material"] for row in rows))
    height = 0.8 / len(materials)
    figure, axes = plt.subplots(figsize=(4.7, 1.1 + 0.34 * len(names)))
    for limit in limits:
        axes.axvline(limit, color=MUTED, linewidth=0.9, linestyle=(0, (4, 2)), zorder=0)
    for row in rows:
        at = names.index(row["coarsening"]) - 0.4
        at += (materials.index(row["material"]) + 0.5) * height
        _mark(axes, row, at, row["resolution"] == finest)
    for material in materials:
        marker, colour = MATERIALS[material]
        axes.plot([], [], marker, color=colour, markersize=4.5, label=material)
    _finish(axes, names)
    figure.legend(
        loc="outside upper left", ncols=3, columnspacing=1.0, handletextpad=0.1, borderpad=0.0
    )
    return figure


def _mark(axes: Any, row: dict[str, Any], at: float, filled: bool) -> None:
    marker, colour = MATERIALS[row["material"]]
    face = colour if filled else "none"
    axes.plot(row["audible_rms"], at, marker, markersize=4.5, color=colour, markerfacecolor=face)


def _finish(axes: Any, names: list[str]) -> None:
    logarithmic(axes.xaxis, percent=True)
    named_rows(axes, names)
    for edge in range(1, len(names)):
        axes.axhline(edge - 0.5, color=FAINT, linewidth=0.5)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.set_xlabel("rms frequency error")
