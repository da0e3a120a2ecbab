"""Figures of spectra, of their convergence and of wall times."""

from __future__ import annotations

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from solver.analysis import RIGID_MODES
from workflow.report.numbers import show
from workflow.report.style import COLOURS, FAINT, SETTINGS
from workflow.report.table import Table
from workflow.report.times_tables import TIMED
from workflow.variants import SHOWN, TRUTH, VARIANTS

Array = NDArray[np.float64]

LINES: dict[str, dict[str, Any]] = {
    TRUTH: {"linewidth": 2.6, "alpha": 0.9},
    "hcms": {"linewidth": 1.3, "linestyle": (0, (4, 2))},
    "hcms_ec": {"linewidth": 1.3},
    "ddfem_hcms_ec": {"linewidth": 1.3},
}
STARTS = {
    "hcms-free": ("HCMS, free interfaces", COLOURS["hcms_ec"]),
    "hcms-fixed": ("HCMS, fixed interfaces", COLOURS["hcms"]),
    "random": ("random vectors", COLOURS["random"]),
}
SMALLEST_ERROR = 1e-12
"""Relative errors below this are rounding and drawn there."""


def spectrum_figure(frequencies: Table, model: str) -> Figure:
    """Frequencies by mode number above, their relative errors below."""
    rows = [row for row in frequencies.rows if row["model"] == model]
    mode = [row["mode"] for row in rows]
    with plt.rc_context(SETTINGS):
        figure, (above, below) = plt.subplots(
            2, 1, figsize=(4.7, 5.0), sharex=True, height_ratios=(1, 1.15)
        )
        for variant in SHOWN:
            style = {"color": COLOURS[variant], "label": VARIANTS[variant].label, **LINES[variant]}
            above.plot(mode, [row[variant] for row in rows], **style)
            if variant != TRUTH:
                below.semilogy(mode, _visible([row[f"{variant}_error"] for row in rows]), **style)
        above.set(ylabel="frequency [Hz]", title="Natural frequencies")
        above.set_ylim(bottom=0)
        above.legend(loc="lower right")
        below.set(xlabel="mode number", ylabel="|relative error|", title="Error of the frequency")
        below.set_xlim(mode[0], mode[-1])
    return figure


def convergence_figure(history: dict[str, Any], truth: ArrayLike) -> Figure:
    """Eigenvalues from several starts, and their relative errors correction by correction.

    Parameters
    ----------
    history : output of `solver convergence`.
    truth : eigenvalues [rad^2/s^2], rigid ones included.
    """
    curves = history["start"]
    exact = np.asarray(truth)[RIGID_MODES:]
    with plt.rc_context(SETTINGS):
        figure = plt.figure(figsize=(7.6, 6.2))
        grid = figure.add_gridspec(2, len(curves), height_ratios=(1.15, 1))
        _plot_eigenvalues(figure.add_subplot(grid[0, :]), curves, exact)
        shared = None
        for column, (start, steps) in enumerate(curves.items()):
            axes = figure.add_subplot(grid[1, column], sharey=shared)
            _plot_errors(axes, steps, exact, *STARTS[start])
            if shared is None:
                axes.set_ylabel("relative error")
            else:
                axes.tick_params(labelleft=False)
            shared = shared or axes
    return figure


def _plot_eigenvalues(axes: Any, curves: dict[str, Any], exact: Array) -> None:
    last = max(len(steps) for steps in curves.values()) - 1
    for start, steps in curves.items():
        label, colour = STARTS[start]
        for step, style in ((0, "--"), (last, "-")):
            values = np.asarray(steps[step])
            text = f"{label}, {_corrections(step)}"
            axes.semilogy(_modes(values), values, style, color=colour, linewidth=1.3, label=text)
    axes.semilogy(
        _modes(exact), exact, color=COLOURS[TRUTH], linewidth=2.6, alpha=0.9, label="ground truth"
    )
    axes.set(xlabel="mode number", ylabel="eigenvalue [rad²/s²]", title="Eigenvalues")
    axes.legend(ncols=2, loc="lower right")
    axes.set_xlim(RIGID_MODES + 1, RIGID_MODES + len(exact))


def _plot_errors(axes: Any, steps: Any, exact: Array, label: str, colour: str) -> None:
    for step, values in enumerate(steps):
        count = min(len(values), len(exact))
        error = np.asarray(values)[:count] / exact[:count] - 1.0
        strength = 0.3 + 0.7 * step / max(1, len(steps) - 1)
        axes.semilogy(
            _modes(error),
            _visible(error),
            color=colour,
            alpha=strength,
            linewidth=1.4,
            label=str(step),
        )
    axes.set(xlabel="mode number", title=f"From {label}")
    axes.legend(title="corrections", title_fontsize=8.5, ncols=len(steps), handlelength=1.0)


def times_figure(times: Table) -> Figure:
    """Wall times of all methods on all models, as bars on a logarithmic axis."""
    rows = times.rows
    labels = {column.key: column.label for column in times.columns}
    height = 0.8 / len(TIMED)
    with plt.rc_context(SETTINGS):
        figure, axes = plt.subplots(figsize=(7.6, 0.9 + 1.05 * len(rows)))
        smallest = min(row[variant] for row in rows for variant in TIMED)
        for index, variant in enumerate(TIMED):
            at = [position - 0.4 + (index + 0.5) * height for position in range(len(rows))]
            seconds = [row[variant] for row in rows]
            bars = axes.barh(
                at, seconds, 0.86 * height, color=COLOURS[variant], label=labels[variant]
            )
            axes.bar_label(bars, [show(value, "seconds") for value in seconds], padding=3, size=8)
        axes.set_xscale("log")
        axes.set_xlim(left=smallest / 2)
        axes.margins(x=0.12)
        axes.set_yticks(range(len(rows)), [row["title"].replace(", ", "\n") for row in rows])
        axes.tick_params(axis="y", length=0)
        axes.grid(axis="y", visible=False)
        axes.spines["left"].set_color(FAINT)
        axes.invert_yaxis()
        axes.set_xlabel("wall time [s]")
        figure.legend(loc="outside upper left", ncols=len(TIMED), columnspacing=1.2)
    return figure


def _modes(values: Array) -> NDArray[np.int64]:
    return np.arange(RIGID_MODES + 1, RIGID_MODES + 1 + len(values))


def _visible(errors: ArrayLike) -> Array:
    return np.maximum(np.abs(np.asarray(errors, dtype=float)), SMALLEST_ERROR)


def _corrections(count: int) -> str:
    if count == 0:
        return "no correction"
    return "1 correction" if count == 1 else f"{count} corrections"
