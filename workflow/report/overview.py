"""One picture that says what the project does: a mode, and its spectrum against the truth."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from solver.analysis import RIGID_MODES
from solver.geometry import HexMesh
from solver.geometry.picture import DRAWN_AMPLITUDE, draw
from solver.modes_file import read_modes
from workflow.report.mode_pictures import aligned, displacement
from workflow.report.plots import LINES
from workflow.report.results import Results
from workflow.report.style import COLOURS, SETTINGS
from workflow.report.table import Table
from workflow.variants import TRUTH, VARIANTS

FAST = "ddfem_hcms_ec"


def overview_figure(results: Results, frequencies: Table, model: str) -> Figure:
    """First elastic mode by the fast method on the left, both spectra on the right."""
    truth = read_modes(results.modes_path(model, TRUTH))
    fast = read_modes(results.modes_path(model, FAST))
    motion, _ = aligned(fast, truth, displacement(truth, RIGID_MODES))
    diagonal = float(np.linalg.norm(np.ptp(truth.mesh.nodes, axis=0)))
    largest = float(np.linalg.norm(motion, axis=1).max())
    rows = [row for row in frequencies.rows if row["model"] == model]
    mode = [row["mode"] for row in rows]
    with plt.rc_context({**SETTINGS, "figure.constrained_layout.use": False}):
        figure = plt.figure(figsize=(10, 4.1))
        body = figure.add_axes((0.0, 0.0, 0.47, 0.92), projection="3d")
        draw(body, fast.mesh, motion, scale=DRAWN_AMPLITUDE * diagonal / largest)
        spectrum = figure.add_axes((0.56, 0.135, 0.42, 0.745))
        for variant in (TRUTH, "hcms_ec", FAST):
            spectrum.plot(
                mode,
                [row[variant] / 1e3 for row in rows],
                color=COLOURS[variant],
                label=_label(variant, fast.mesh if variant == FAST else truth.mesh),
                **LINES[variant],
            )
        spectrum.set(xlabel="mode number", ylabel="frequency [kHz]")
        spectrum.set_xlim(mode[0], mode[-1])
        spectrum.set_ylim(bottom=0)
        spectrum.legend(loc="upper left")
        hertz = fast.frequencies[RIGID_MODES]
        figure.text(0.03, 0.93, f"{results.title(model)}: mode 7, {hertz:,.0f} Hz", weight="bold")
        figure.text(0.56, 0.93, f"Spectrum, {len(mode)} elastic modes", weight="bold")
    return figure


def _label(variant: str, mesh: HexMesh) -> str:
    name = "SLEPc" if variant == TRUTH else VARIANTS[variant].label
    return f"{name}, {mesh.n_dofs:,} unknowns"
