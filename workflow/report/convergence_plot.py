"""Figure of how the eigenvalues approach the truth, correction by correction (Fig. 10)."""

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from studies.base.colours import COLOURS
from studies.base.results import Results
from workflow.report.convergence_tables import ACCELERATIONS, PAPER, RANDOM, start_label
from workflow.variants import TRUTH

Array = NDArray[np.float64]

SMALLEST_ERROR = 1e-12
"""Relative errors below this are rounding and drawn there."""
HCMS_COLOURS = ("hcms_ec", "hcms", "ddfem_slepc")
"""Colours of the interface treatments, in their order."""


def convergence_figure(results: Results, model: str) -> Figure:
    """Eigenvalues from several starts, and small multiples of their errors."""
    history = results.read_json(f"models/{model}/convergence.json")
    exact, first = np.array(history["exact"]), history["rigid_modes"] + 1
    curves = {
        (curve["acceleration"], curve["start"]): np.array(curve["values"])
        for curve in history["histories"]
    }
    starts = list(dict.fromkeys(start for _, start in curves))
    colours = _colours(starts)
    figure = plt.figure(figsize=(1.2 + 2.15 * len(starts), 8.2))
    grid = figure.add_gridspec(
        1 + len(ACCELERATIONS), len(starts), height_ratios=(1.2, *(1 for _ in ACCELERATIONS))
    )
    paper = {start: curves[PAPER, start] for start in starts}
    _plot_eigenvalues(figure.add_subplot(grid[0, :]), paper, exact, colours, first)
    shared = None
    for row, (acceleration, label) in enumerate(ACCELERATIONS.items(), start=1):
        for column, start in enumerate(starts):
            axes = figure.add_subplot(grid[row, column], sharey=shared, sharex=shared)
            _plot_errors(axes, curves[acceleration, start], exact, colours[start], first)
            if row == 1:
                axes.set_title(start_label(start).removesuffix(" interfaces"))
            if row == len(ACCELERATIONS):
                axes.set_xlabel("mode number")
            if column:
                axes.tick_params(labelleft=False)
            else:
                axes.set_ylabel(f"relative error\n{label}")
            shared = shared or axes
    return figure


def _colours(starts: list[str]) -> dict[str, str]:
    treatments = [start for start in starts if start != RANDOM]
    colours = {
        start: COLOURS[HCMS_COLOURS[number % len(HCMS_COLOURS)]]
        for number, start in enumerate(treatments)
    }
    return {**colours, RANDOM: COLOURS[RANDOM]}


def _plot_eigenvalues(
    axes: Any, curves: dict[str, Array], exact: Array, colours: dict[str, str], first: int
) -> None:
    for start, steps in curves.items():
        for step, style in ((0, "--"), (len(steps) - 1, "-")):
            label = f"{start_label(start)}, {_corrections(step)}"
            values = steps[step]
            axes.semilogy(
                _modes(values, first), values, style, color=colours[start], lw=1.3, label=label
            )
    axes.semilogy(
        _modes(exact, first), exact, color=COLOURS[TRUTH], lw=2.6, alpha=0.9, label="ground truth"
    )
    axes.set(xlabel="mode number", ylabel="eigenvalue [rad²/s²]", title="Eigenvalues")
    axes.legend(ncols=2, loc="lower right")
    axes.set_xlim(first, first + len(exact) - 1)


def _plot_errors(axes: Any, steps: Array, exact: Array, colour: str, first: int) -> None:
    for step, values in enumerate(steps):
        axes.semilogy(
            _modes(exact, first),
            visible(values / exact - 1.0),
            color=colour,
            alpha=0.3 + 0.7 * step / max(1, len(steps) - 1),
            linewidth=1.4,
            label=str(step),
        )
    axes.legend(title="corrections", title_fontsize=8.5, ncols=2, handlelength=1.0)


def visible(errors: ArrayLike) -> Array:
    """Magnitude of relative errors, `SMALLEST_ERROR` at least."""
    return np.maximum(np.abs(np.asarray(errors, dtype=float)), SMALLEST_ERROR)


def _modes(values: Array, first: int) -> NDArray[np.int64]:
    return np.arange(first, first + len(values))


def _corrections(count: int) -> str:
    if count == 0:
        return "no correction"
    return "1 correction" if count == 1 else f"{count} corrections"
