"""Figures of the study."""

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from studies.base.colours import COLOURS
from studies.base.style import logarithmic
from studies.thin_walls.results import ThinWallStudy
from studies.thin_walls.sizes import CELLS, TETRAHEDRA, WHOLE
from studies.thin_walls.tables import LABELS

LOOKS = {
    CELLS: ("o-", COLOURS["ddfem_hcms_ec"]),
    WHOLE: ("s-", COLOURS["hcms"]),
    TETRAHEDRA: ("D--", COLOURS["hcms_ec"]),
}
"""Marker, line and colour of each discretisation."""
COLUMNS = 3
SMOOTH, JOINED = ("ring", "hemisphere"), ("wine-glass", "skillet")
"""Solids whose convergence is shown: a smooth wall, and a joint; the first of each that is there
"""


def unknowns_figure(study: ThinWallStudy) -> Figure:
    """Rms error over unknowns, a panel a solid."""
    return _over(study, study.over_size, "unknowns", "unknowns")


def seconds_figure(study: ThinWallStudy) -> Figure:
    """Rms error over wall time, a panel a solid."""
    return _over(study, study.over_size, "seconds", "wall time [s]")


def convergence_figure(study: ThinWallStudy) -> Figure:
    """Rms error over the spacing with fitted slopes, of a smooth wall and of one with a joint."""
    there = study.over_size
    chosen = [next((name for name in each if name in there), "") for each in (SMOOTH, JOINED)]
    return _over(study, list(filter(None, chosen)) or there[:1], "spacing", "spacing [mm]", True)


def _over(
    study: ThinWallStudy, solids: Sequence[str], size: str, label: str, fitted: bool = False
) -> Figure:
    columns = min(COLUMNS, max(1, len(solids)))
    rows = max(1, -(-len(solids) // columns))
    figure, panels = plt.subplots(
        rows, columns, figsize=(7.6, 0.8 + 2.2 * rows), sharex=not fitted, squeeze=False
    )
    for panel, solid in zip(panels.flat, solids):
        _draw(panel, study, solid, size, fitted)
        panel.set_title(study.titles[solid])
    for panel in panels.flat[len(solids) :]:
        panel.set_visible(False)
    for panel in panels[-1]:
        panel.set_xlabel(label)
    for panel in panels[:, 0]:
        panel.set_ylabel("rms error")
    found = [panel.get_legend_handles_labels() for panel in panels.flat if not fitted]
    handles = {label: handle for each in found for handle, label in zip(*each)}
    if handles:
        figure.legend(handles.values(), handles.keys(), loc="outside upper left", ncols=3)
    return figure


def _draw(panel: Axes, study: ThinWallStudy, solid: str, size: str, fitted: bool) -> None:
    rates = {
        row["discretisation"]: row["rate"]
        for row in study.measured["summary"]
        if row["solid"] == solid
    }
    factor = 1e3 if size == "spacing" else 1.0
    for discretisation, (look, colour) in LOOKS.items():
        levels = study.levels(solid, discretisation)
        if not levels:
            continue
        values = factor * np.array([level[size] for level in levels])
        rms = np.array([level["rms"] for level in levels])
        label, rate = LABELS[discretisation], rates.get(discretisation)
        if fitted and rate is not None:
            label += f": {rate:.1f}"
            middle = np.exp(np.log(rms / values**rate).mean())
            panel.plot(values, middle * values**rate, ":", color=colour, linewidth=0.9)
            look = look[0]
        panel.plot(values, rms, look, color=colour, markersize=4.5, label=label)
    logarithmic(panel.xaxis, panel.yaxis)
    panel.yaxis.set_major_formatter(lambda value, _: f"{100.0 * value:g} %")
    if fitted:
        panel.legend()
