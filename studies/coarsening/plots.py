"""Figures of the study."""

from typing import Any

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from studies.base.colours import COLOURS, MUTED
from studies.base.style import logarithmic, named_rows
from studies.coarsening.results import MODELS, CoarseningStudy

COLOUR = {"plain": COLOURS["ddfem_hcms_ec"], "refined": COLOURS["hcms_ec"]}
LABEL = {"plain": "coarse", "refined": "refined"}
MARKERS = {"uniform": "o", "smooth": "s", "two-region": "^", "noise": "D", "random": "v"}
"""Marker of each material."""

SMALLEST = 1e-4
"""Smaller errors are drawn there."""

DASHED = (0, (4, 2))


def expected_figure(study: CoarseningStudy) -> Figure:
    """True rms error over the expected one, every case and both models."""
    rows = study.table("cases").rows
    figure, axes = plt.subplots(figsize=(5.2, 4.4))
    drawn = []
    for model in MODELS:
        for material in study.part["materials"]:
            of_material = [row for row in rows if row["material"] == material]
            expected = [_drawn(row[f"{model}_expected_rms"]) for row in of_material]
            true = [_drawn(row[f"{model}_rms"]) for row in of_material]
            drawn += expected + true
            axes.plot(
                expected,
                true,
                MARKERS[material],
                color=COLOUR[model],
                markersize=5.0,
                markerfacecolor="none" if model == "refined" else COLOUR[model],
                label=f"{LABEL[model]}, {material}",
            )
    ends = (0.7 * min(drawn), 1.4 * max(drawn))
    axes.plot(ends, ends, color=MUTED, linewidth=0.9, zorder=0)
    logarithmic(axes.xaxis, axes.yaxis, percent=True)
    axes.set(xlim=ends, ylim=ends, xlabel="expected rms error", ylabel="true rms error")
    figure.legend(loc="outside upper left", ncols=2, columnspacing=1.0, handletextpad=0.1)
    return figure


def errors_figure(study: CoarseningStudy) -> Figure:
    """Rms and worst error of every case in both models, with the limits of both."""
    rows = study.table("cases").rows
    resolutions = {row["resolution"] for row in rows}
    names = [_name(row, len(resolutions) > 1) for row in rows]
    figure, axes = plt.subplots(figsize=(7.6, 1.4 + 0.21 * len(rows)))
    for limit in (study.goals["rms"], study.goals["worst"]):
        axes.axvline(limit, color=MUTED, linewidth=0.9, linestyle=DASHED, zorder=0)
    for model, shift in zip(MODELS, (-0.14, 0.14), strict=True):
        for key, marker, size in (("rms", "o", 5.0), ("worst", "|", 9.0)):
            values = [_drawn(row[f"{model}_{key}"]) for row in rows]
            places = [place + shift for place in range(len(rows))]
            label = f"{LABEL[model]}, {key}"
            axes.plot(values, places, marker, color=COLOUR[model], markersize=size, label=label)
    logarithmic(axes.xaxis, percent=True)
    named_rows(axes, names)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set_xlabel("frequency error")
    figure.legend(loc="outside upper left", ncols=4, columnspacing=1.0, handletextpad=0.1)
    return figure


def _name(row: dict[str, Any], with_resolution: bool) -> str:
    resolution = f" {row['resolution']}" if with_resolution else ""
    return f"{row['title']}{resolution}, {row['material']}"


def _drawn(error: float) -> float:
    return max(abs(error), SMALLEST)
