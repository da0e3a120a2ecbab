"""Figures of an example's page."""

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from numpy.typing import NDArray

from studies.base.colours import COLOURS, INK, MUTED
from studies.base.media import COLOUR_MAP
from studies.base.style import logarithmic
from studies.base.table import Table
from studies.sounds.results import SoundResults
from studies.sounds.tables import METHODS

Array = NDArray[np.float64]

STATES = {"start": COLOURS["hcms"], "target": INK, "found": COLOURS["ddfem_hcms_ec"]}
"""Colours of what was before, of targets, and of the design."""
LABELS = {"start": "before", "target": "target", "found": "after"}
_MIN_SHARE = 1e-4
"""Part of the largest cost below which nothing is drawn."""


def cost_figure(results: SoundResults) -> Figure:
    """Cost over the processor time of all edits, and the weighted parts that it is the sum of."""
    weights = results.design.settings["weights"]
    lines = {
        "cost": ("cost", INK, 1.0),
        "frequency_cost": ("of frequencies", COLOURS["hcms_ec"], weights["frequency"]),
        "amplitude_cost": ("of amplitudes", COLOURS["ddfem_hcms_ec"], weights["amplitude"]),
    }
    histories = [results.history(part) for part in results.example.parts]
    begins = np.cumsum([0.0, *(rows["seconds"][-1] for rows in histories)])
    figure, axes = plt.subplots(figsize=(4.7, 3.3))
    for number, (rows, begin) in enumerate(zip(histories, begins)):
        for key, (label, colour, weight) in lines.items():
            style: Any = {"color": colour, "linewidth": 2.2 if key == "cost" else 1.2}
            values = _positive(weight * rows[key])
            name = None if number else label
            axes.plot(begin + rows["seconds"], values, label=name, **style)
    for begin in begins[1:-1]:
        axes.axvline(begin, color=MUTED, linewidth=0.9, linestyle=(0, (1, 2)))
    _cost_axes(axes)
    axes.set_xlim(0.0, begins[-1])
    axes.legend(loc="upper right")
    return figure


def optimisers_figure(compared: dict[str, Any]) -> Figure:
    """Cost over processor time by every optimiser."""
    colours = {"hybrid": COLOURS["ddfem_hcms_ec"], "cma": COLOURS["ddfem_slepc"]}
    figure, axes = plt.subplots(figsize=(4.7, 3.3))
    for row in compared["rows"]:
        seconds, cost = np.array(row["curve"], dtype=float).T
        colour = colours.get(row["method"], COLOURS["hcms_ec"])
        width = 2.2 if row["method"] == "hybrid" else 1.3
        label = METHODS[row["method"]]
        axes.plot(seconds, _positive(cost), color=colour, linewidth=width, label=label)
    _cost_axes(axes)
    axes.set_xlim(left=0.0)
    axes.legend(loc="upper right")
    return figure


def frequency_figure(frequencies: Table, truth: Table) -> Figure:
    """How far frequencies are from their targets, before, after and on the fine model."""
    mode = [row["mode"] for row in frequencies.rows]
    figure, axes = plt.subplots(figsize=(4.7, 3.3))
    axes.axhline(0.0, color=INK, linewidth=1.0)
    for state in ("start", "found"):
        values = [row[f"{state}_bark"] for row in frequencies.rows]
        axes.plot(mode, values, "o-", ms=3.5, lw=1.0, color=STATES[state], label=LABELS[state])
    fine = [row["bark"] for row in truth.rows]
    style: dict[str, Any] = {"color": COLOURS["hcms_ec"], "label": "after, fine model"}
    axes.plot(mode[: len(fine)], fine, "d", ms=4.0, fillstyle="none", **style)
    axes.set(xlabel="mode", ylabel="difference [bark]", title="Frequencies from their targets")
    axes.set_xlim(0.5, mode[-1] + 0.5)
    axes.legend(loc="best")
    return figure


def balance_figure(amplitudes: Table, point: str) -> Figure:
    """Amplitudes of the modes at one point, as shares of the loudest."""
    rows = [row for row in amplitudes.rows if row["point"] == point]
    mode = np.array([row["mode"] for row in rows])
    figure, axes = plt.subplots(figsize=(4.7, 2.1))
    target = [row["target"] for row in rows]
    axes.bar(mode, target, 0.8, color=MUTED, alpha=0.45, label=LABELS["target"])
    for state, marker, size in (("start", "o", 3.0), ("found", "D", 4.0)):
        values = [row[state] for row in rows]
        style: Any = {"color": STATES[state], "label": LABELS[state]}
        axes.plot(mode, values, marker, ms=size, ls="none", **style)
    axes.set(xlabel="mode", ylabel="share of the loudest", ylim=(0.0, 1.08))
    axes.set_xlim(0.3, mode[-1] + 0.7)
    axes.grid(axis="x", visible=False)
    figure.legend(loc="outside upper right", ncols=3, columnspacing=1.2)
    return figure


def colour_bar(young: Array) -> Figure:
    """What the colours of the material mean [GPa]."""
    low, high = limits(young)
    with plt.rc_context({"axes.grid": False}):
        figure, axes = plt.subplots(figsize=(4.7, 0.62))
        shades = ScalarMappable(LogNorm(low / 1e9, high / 1e9), COLOUR_MAP)
        bar = figure.colorbar(shades, cax=axes, orientation="horizontal")
        bar.set_label("Young’s modulus [GPa]")
        bar.outline.set_visible(False)
        bar.ax.minorticks_off()
        bar.set_ticks(_ticks(low / 1e9, high / 1e9))
        bar.ax.xaxis.set_major_formatter("{x:g}")
    return figure


def limits(young: Array) -> tuple[float, float]:
    """Moduli [Pa] at both ends of the colours."""
    low, high = float(young.min()), float(young.max())
    return (low, high) if high > 1.001 * low else (0.5 * low, 2.0 * high)


def _cost_axes(axes: Any) -> None:
    axes.set(xlabel="processor time [s]", ylabel="cost [1]", title="Cost")
    logarithmic(axes.yaxis)


def _ticks(low: float, high: float) -> list[float]:
    """Round values between two: powers of ten, with 2 and 5 between them if these are few."""
    decades = np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1)
    for steps in ((1.0,), (1.0, 3.0), (1.0, 2.0, 5.0), tuple(np.arange(1.0, 10.0))):
        values = np.array([step * 10.0**decade for decade in decades for step in steps])
        inside = values[(values >= low) & (values <= high)]
        if len(inside) >= 3:
            return [float(value) for value in inside]
    return [float(f"{value:.2g}") for value in np.geomspace(low, high, 3)]


def _positive(values: Array) -> Array:
    return np.asarray(np.maximum(values, _MIN_SHARE * values.max()))
