"""Figures of the study: time and memory over unknowns, a line a method."""

from collections.abc import Mapping
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from studies.base.colours import COLOURS
from studies.base.numbers import show
from studies.base.style import logarithmic, plain
from studies.crossover.methods import METHODS
from studies.crossover.results import NO, YES, Crossover, frame_of
from studies.crossover.winners import PANEL, in_words

LOOKS = {
    "hcms": ("o", COLOURS["hcms"]),
    "hcms_ec": ("o", COLOURS["hcms_ec"]),
    "lanczos": ("s", COLOURS["fastest"]),
    "lobpcg": ("D", COLOURS["ddfem_hcms_ec"]),
    "coarse_lobpcg": ("P", COLOURS["ddfem_hcms_ec_accurate"]),
    "hcms_lobpcg": ("D", COLOURS["random"]),
    "slepc": ("^", COLOURS["ddfem_slepc"]),
    "arpack": ("v", COLOURS["truth"]),
}
"""Marker and colour of each method."""
APART = 0.085
"""Least distance of two labels as a share of the height of the axes."""


def seconds_figure(study: Crossover) -> Figure:
    """Wall time over unknowns, a row of panels a tolerance and launch, a column a number of modes.

    Marks are hollow where the tolerance was missed.
    """
    return _figure(study.table("runs").rows, PANEL, "seconds", "wall time [s]", 1.0)


def memory_figure(study: Crossover) -> Figure:
    """Peak memory of the largest rank over unknowns, at the smallest tolerance."""
    rows = study.table("runs").rows
    least = min(row["tolerance"] for row in rows)
    rows = [row for row in rows if row["tolerance"] == least]
    return _figure(rows, PANEL[:-1], "peak_memory_bytes", "memory of the largest rank [MB]", 1e-6)


def panel_title(about: Mapping[str, Any], several: bool = False) -> str:
    """Tolerance, ranks, nodes and latency in words; the machine, too, if there are several."""
    parts = [] if "tolerance" not in about else [f"to {in_words(about['tolerance'])}"]
    nodes, ranks = int(about["nodes"]), int(about["ranks"])
    parts.append(f"{ranks} rank{'s' * (ranks > 1)}")
    parts += [f"{nodes} nodes"] if nodes > 1 else []
    if not pd.isna(about["latency"]):
        parts.append(f"latency {show(about['latency'], 'seconds')}")
    return ", ".join(parts + [str(about["machine"])] * several)


def _figure(
    rows: list[dict[str, Any]], panel: list[str], key: str, label: str, unit: float
) -> Figure:
    frame = frame_of(rows).dropna(subset=[key]).sort_values("unknowns")
    groups = list(frame.groupby(panel, dropna=False))
    modes = sorted(set(frame["modes"])) or [0]
    several = frame["machine"].nunique() > 1
    figure, axes = plt.subplots(
        max(1, len(groups)),
        len(modes),
        figsize=(max(4.6, 3.9 * len(modes)), 0.3 + 2.7 * max(1, len(groups))),
        sharex=True,
        sharey=True,
        squeeze=False,
    )
    ends = {}
    for line, (names, group) in zip(axes, groups):
        title = panel_title(dict(zip(panel, names)), several)
        for axis, count in zip(line, modes, strict=True):
            own = group[group["modes"] == count]
            logarithmic(axis.xaxis, axis.yaxis)
            axis.set_title(plain(f"{int(count)} modes, {title}"))
            ends[axis] = _lines(axis, own.assign(value=own[key] * unit))
        line[0].set_ylabel(label)
    for axis in axes[-1]:
        axis.set_xlabel("unknowns")
    # All panels have the same limits once every line is drawn.
    for axis, own in ends.items():
        _labelled(axis, own)
    return figure


def _lines(axis: Any, rows: pd.DataFrame) -> dict[str, float]:
    """Draw a line a method; returns the value at which each ends."""
    ends = {}
    for method, part in rows.groupby("method"):
        marker, colour = LOOKS[str(method)]
        axis.plot(part["unknowns"], part["value"], "-", color=colour, linewidth=1.3)
        for reached, face in ((YES, colour), (NO, "white")):
            own = part[part["reached"] == reached]
            style = {"markersize": 4.5, "color": colour, "markerfacecolor": face}
            axis.plot(own["unknowns"], own["value"], marker, **style)
        ends[str(method)] = part["value"].iloc[-1]
    return ends


def _labelled(axis: Any, ends: Mapping[str, float]) -> None:
    """Write the names of the methods right of the axes, as high as their lines end, but apart."""
    low, high = np.log(axis.get_ylim())
    heights = {name: (np.log(end) - low) / (high - low) for name, end in ends.items()}
    order = sorted(heights, key=heights.__getitem__)
    at = -np.inf
    places = {}
    for name in order:
        places[name] = at = max(heights[name], at + APART)
    above = max(0.0, at - 1.0)
    for name, place in places.items():
        axis.annotate(
            METHODS[name].label,
            (1.02, place - above),
            xycoords="axes fraction",
            color=LOOKS[name][1],
            fontsize=8.0,
            va="center",
        )
