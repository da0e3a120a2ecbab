"""Figures of the study."""

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from studies.accuracy.results import AccuracyStudy
from studies.accuracy.tables import LABELS
from studies.base.colours import COLOURS
from studies.base.style import logarithmic

LOOKS = {
    "voxel": ("s-", COLOURS["hcms"]),
    "finite-cell": ("o-", COLOURS["ddfem_hcms_ec"]),
    "linear tetrahedra": ("^--", COLOURS["ddfem_slepc"]),
    "quadratic tetrahedra": ("D--", COLOURS["hcms_ec"]),
}
"""Marker, line and colour of each discretisation."""
COLUMNS = 2


def unknowns_figure(study: AccuracyStudy) -> Figure:
    """Rms error over unknowns, a panel a solid."""
    return _figure(study, "unknowns", "unknowns")


def seconds_figure(study: AccuracyStudy) -> Figure:
    """Rms error over wall time, a panel a solid."""
    return _figure(study, "seconds", "wall time [s]")


def _figure(study: AccuracyStudy, size: str, label: str) -> Figure:
    rows = -(-len(study.titles) // COLUMNS)
    figure, panels = plt.subplots(
        rows, COLUMNS, figsize=(7.6, 0.8 + 2.4 * rows), sharex=True, squeeze=False
    )
    for panel, (solid, title) in zip(panels.flat, study.titles.items()):
        for discretisation in study.discretisations:
            levels = study.levels(solid, discretisation)
            look, colour = LOOKS[discretisation]
            panel.plot(
                [level[size] for level in levels],
                [level["rms"] for level in levels],
                look,
                color=colour,
                markersize=4.5,
                label=LABELS[discretisation],
            )
        logarithmic(panel.xaxis, panel.yaxis)
        panel.yaxis.set_major_formatter(lambda value, _: f"{100.0 * value:g} %")
        panel.set_title(title)
    for panel in panels.flat[len(study.titles) :]:
        panel.set_visible(False)
    for panel in panels[-1]:
        panel.set_xlabel(label)
    for panel in panels[:, 0]:
        panel.set_ylabel("rms error")
    handles, labels = panels.flat[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=4, columnspacing=1.2)
    return figure
