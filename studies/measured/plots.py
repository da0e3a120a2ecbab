"""Figures of the study."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from studies.base.colours import COLOURS, FAINT
from studies.measured.measure import CELLS, LABELS, WITHOUT
from studies.measured.results import MeasuredStudy, model_of

LOOKS = {WITHOUT: ("_", COLOURS["hcms_ec"]), CELLS: (".", COLOURS["ddfem_hcms_ec"])}
"""Marker and colour of each model."""
COLUMNS = 2


def errors_figure(study: MeasuredStudy) -> Figure:
    """Errors of every frequency, a panel a solid; the band is what the data are good for."""
    rows = max(1, -(-len(study.rated) // COLUMNS))
    figure, panels = plt.subplots(rows, COLUMNS, figsize=(7.6, 0.8 + 1.7 * rows), squeeze=False)
    for panel, solid in zip(panels.flat, study.rated):
        given = np.array([np.nan if hertz is None else hertz for hertz in solid["hertz"]])
        numbers = np.arange(1, len(given) + 1)
        band = 100.0 * solid["uncertainty"]
        panel.axhspan(-band, band, color=FAINT, alpha=0.6)
        for kind, (marker, colour) in LOOKS.items():
            if (model := model_of(solid, kind)) is not None:
                errors = 100.0 * (np.array(model["hertz"]) / given - 1.0)
                panel.plot(numbers, errors, marker, color=colour, label=LABELS[kind])
        panel.yaxis.set_major_formatter(lambda value, _: f"{value:g} %")
        panel.set_title(solid["title"])
    for panel in panels.flat[len(study.rated) :]:
        panel.set_visible(False)
    for panel in panels[-1]:
        panel.set_xlabel("number of the frequency")
    found = [panel.get_legend_handles_labels() for panel in panels.flat]
    handles = {label: handle for each in found for handle, label in zip(*each)}
    figure.legend(handles.values(), handles.keys(), loc="outside upper left", ncols=2)
    return figure
