"""Figures of the study."""

from typing import Any

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from studies.base.colours import COLOURS, INK
from studies.base.style import logarithmic, plain
from studies.discretisation.results import DiscretisationStudy
from studies.discretisation.tables import WAYS

COLOUR = {
    "voxels": INK,
    "coarse": COLOURS["ddfem_hcms_ec"],
    "refined": COLOURS["random"],
    "half-cells": COLOURS["ddfem_hcms_ec_accurate"],
    "half-cells-divided": COLOURS["ddfem_slepc"],
    "half-cells-harmonic": COLOURS["hcms"],
    "cells": COLOURS["hcms_ec"],
}
MARKERS = "osD^vP*Xph<>"
"""Markers of the solids, in turn."""
SMALLEST = 1e-4
"""Smaller errors are drawn there."""
PANELS = 2
"""Side by side."""


def unknowns_figure(study: DiscretisationStudy) -> Figure:
    """Rms error of every case over its unknowns, a panel a material."""
    return _errors_over(study, "unknowns", "unknowns")


def seconds_figure(study: DiscretisationStudy) -> Figure:
    """Rms error of every case over its wall time [s], a panel a material."""
    return _errors_over(study, "seconds", "wall time [s]")


def _errors_over(study: DiscretisationStudy, key: str, label: str) -> Figure:
    rows = study.table("cases").rows
    materials = study.part["materials"]
    solids = list(dict.fromkeys(row["title"] for row in rows))
    marker = {title: MARKERS[at % len(MARKERS)] for at, title in enumerate(solids)}
    high = -(-len(materials) // PANELS)
    wide = min(PANELS, len(materials))
    size = (1.0 + 3.3 * wide, 1.5 + 2.4 * high)
    figure, panels = plt.subplots(high, wide, figsize=size, sharex=True, sharey=True, squeeze=False)
    for axes in panels.flat[len(materials) :]:
        axes.set_visible(False)
    for axes, material in zip(panels.flat, materials, strict=False):
        for row in rows:
            if row["material"] == material:
                error = max(row["solid_rms"], SMALLEST)
                colour = COLOUR[row["name"]]
                axes.plot(row[key], error, marker[row["title"]], color=colour, markersize=4.5)
        axes.set_title(material)
        logarithmic(axes.xaxis)
        logarithmic(axes.yaxis, percent=True)
    for axes in panels[:, 0]:
        axes.set_ylabel("rms frequency error")
    for axes in panels[-1]:
        axes.set_xlabel(label)
    _legend(figure, panels[0, 0], marker)
    return figure


def _legend(figure: Figure, axes: Any, marker: dict[str, str]) -> None:
    for name, label in WAYS.items():
        axes.plot([], [], "o", color=COLOUR[name], label=label, markersize=4.5)
    for title, shape in marker.items():
        axes.plot([], [], shape, color="none", markeredgecolor=INK, label=plain(title))
    figure.legend(loc="outside upper left", ncols=4, columnspacing=1.0, handletextpad=0.1)
