"""One picture that says what the project does: a mode, and its spectrum, against the truth."""

from __future__ import annotations

from typing import Any

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from carillon.drawing.solid import draw
from carillon.fem.model import RIGID_MODES
from solver.files.modes_file import read_modes
from studies.base.colours import COLOURS, MUTED
from studies.base.style import plain
from workflow.report.mode_pictures import aligned, displacement, view_of
from workflow.report.plots import LINES
from workflow.report.results import Run
from workflow.variants import TRUTH, VARIANTS

COMPARED = (TRUTH, "hcms_ec", "ddfem_hcms_ec")


def overview_figure(results: Run, model: str) -> Figure:
    """First elastic mode of the truth and of the fastest method, and the spectra of both."""
    truth = read_modes(results.modes_path(model, TRUTH))
    reference = displacement(truth, RIGID_MODES)
    skin = results.skin(model, truth.model)
    view = view_of(truth.mesh, reference, skin)
    fast = results.shown_variants(model)[-1]
    with plt.rc_context({"figure.constrained_layout.use": False}):
        figure = plt.figure(figsize=(11.6, 3.9))
        for column, variant in enumerate((TRUTH, fast)):
            left = 0.01 + 0.3 * column
            file = truth if variant == TRUTH else read_modes(results.modes_path(model, fast))
            motion, _ = aligned(file, truth, reference, skin)
            body = figure.add_axes((left, 0.0, 0.29, 0.84), projection="3d")
            draw(body, file.mesh, motion, **view)
            figure.text(left + 0.01, 0.93, _label(variant), weight="bold", size=10.5)
            hertz = file.frequencies[RIGID_MODES]
            text = f"{file.mesh.n_dofs:,} unknowns, mode 7 at {hertz:,.0f} Hz"
            figure.text(left + 0.01, 0.87, text, color=MUTED)
        rows = [row for row in results.table("frequencies").rows if row["model"] == model]
        _plot_spectra(figure.add_axes((0.68, 0.13, 0.305, 0.69)), rows)
        figure.text(0.68, 0.93, plain(results.titles[model]), weight="bold", size=10.5)
        figure.text(0.68, 0.87, f"{len(rows)} natural frequencies", color=MUTED)
    return figure


def _plot_spectra(axes: Any, rows: list[dict[str, Any]]) -> None:
    mode = [row["mode"] for row in rows]
    for variant in (name for name in COMPARED if name in rows[0]):
        kilohertz = [row[variant] / 1e3 for row in rows]
        axes.plot(mode, kilohertz, color=COLOURS[variant], label=_label(variant), **LINES[variant])
    axes.set(xlabel="mode number", ylabel="frequency [kHz]")
    axes.set_xlim(mode[0], mode[-1])
    axes.set_ylim(bottom=0)
    axes.legend(loc="lower right")


def _label(variant: str) -> str:
    return "Ground truth (SLEPc)" if variant == TRUTH else VARIANTS[variant].label
