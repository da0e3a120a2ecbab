"""Figures of spectra and of wall times."""

from __future__ import annotations

from typing import Any

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from studies.base.colours import COLOURS, FAINT
from studies.base.numbers import show
from studies.base.results import Results
from studies.base.style import named_rows, plain
from workflow.report.convergence_plot import visible
from workflow.report.spectra_tables import TIMED
from workflow.variants import SHOWN, TRUTH, VARIANTS

LINES: dict[str, dict[str, Any]] = {
    TRUTH: {"linewidth": 2.6, "alpha": 0.9},
    "hcms": {"linewidth": 1.3, "linestyle": (0, (4, 2))},
    "hcms_ec": {"linewidth": 1.3},
    "ddfem_hcms_ec": {"linewidth": 1.3},
}


def spectrum_figure(run: Results, model: str) -> Figure:
    """Frequencies by mode number above, their relative errors below."""
    rows = [row for row in run.table("frequencies").rows if row["model"] == model]
    mode = [row["mode"] for row in rows]
    figure, (above, below) = plt.subplots(
        2, 1, figsize=(4.7, 5.0), sharex=True, height_ratios=(1, 1.15)
    )
    for variant in (name for name in SHOWN if name in rows[0]):
        style = {"color": COLOURS[variant], "label": VARIANTS[variant].label, **LINES[variant]}
        above.plot(mode, [row[variant] for row in rows], **style)
        if variant != TRUTH:
            below.semilogy(mode, visible([row[f"{variant}_error"] for row in rows]), **style)
    above.set(ylabel="frequency [Hz]", title="Natural frequencies")
    above.set_ylim(bottom=0)
    above.legend(loc="lower right")
    below.set(xlabel="mode number", ylabel="|relative error|", title="Error of the frequency")
    below.set_xlim(mode[0], mode[-1])
    return figure


def times_figure(run: Results) -> Figure:
    """Wall times of all methods on all models, as bars on a logarithmic axis."""
    times = run.table("times")
    rows = times.rows
    labels = {column.key: column.label for column in times.columns}
    height = 0.8 / len(TIMED)
    figure, axes = plt.subplots(figsize=(7.6, 0.9 + 1.05 * len(rows)))
    smallest = min(row[variant] for row in rows for variant in TIMED if variant in row)
    for index, variant in enumerate(TIMED):
        there = [number for number, row in enumerate(rows) if variant in row]
        at = [position - 0.4 + (index + 0.5) * height for position in there]
        seconds = [rows[number][variant] for number in there]
        bars = axes.barh(at, seconds, 0.86 * height, color=COLOURS[variant], label=labels[variant])
        axes.bar_label(bars, [show(value, "seconds") for value in seconds], padding=3, size=8)
    axes.set_xscale("log")
    axes.set_xlim(left=smallest / 2)
    axes.margins(x=0.12)
    named_rows(axes, [plain(row["title"]).replace(", ", "\n") for row in rows])
    axes.spines["left"].set_color(FAINT)
    axes.set_xlabel("wall time [s]")
    figure.legend(loc="outside upper left", ncols=len(TIMED), columnspacing=1.2)
    return figure
