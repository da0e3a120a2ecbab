"""Figures of spectra and of wall times."""

from collections.abc import Iterator, Sequence
from typing import Any

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from studies.base.colours import COLOURS, FAINT, INK, MUTED
from studies.base.numbers import show
from studies.base.results import Results
from studies.base.style import named_rows, plain
from studies.base.table import MAX, MIN, Row
from workflow.report.convergence_plot import visible
from workflow.report.methods_tables import METHODS
from workflow.report.spectra_tables import TIMED
from workflow.variants import SHOWN, TRUTH, VARIANTS

LINES: dict[str, dict[str, Any]] = {
    TRUTH: {"linewidth": 2.6, "alpha": 0.9},
    "hcms": {"linewidth": 1.3, "linestyle": (0, (4, 2))},
    "hcms_ec": {"linewidth": 1.3},
    "ddfem_hcms_ec": {"linewidth": 1.3},
}


METHOD_COLOURS = {
    "arpack": MUTED,
    "slepc": COLOURS["truth"],
    "ddfem": COLOURS["ddfem_slepc"],
    "hcms": COLOURS["hcms"],
    "hcms_ec": COLOURS["hcms_ec"],
    "fastest": COLOURS["fastest"],
    "ddfem_ec_accurate": COLOURS["ddfem_hcms_ec_accurate"],
    "ddfem_ec": COLOURS["ddfem_hcms_ec"],
    "ddfem_ec_warm": COLOURS["random"],
    "arpack_regular": FAINT,
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
    figure, axes = plt.subplots(figsize=(7.6, 0.9 + 1.05 * len(rows)))
    smallest = min(row[variant] for row in rows for variant in TIMED if variant in row)
    for variant, height, at, timed in _bars(TIMED, rows):
        seconds = [row[variant] for row in timed]
        bars = axes.barh(at, seconds, height, color=COLOURS[variant], label=labels[variant])
        axes.bar_label(bars, [show(value, "seconds") for value in seconds], padding=3, size=8)
    axes.set_xscale("log")
    axes.set_xlim(left=smallest / 2)
    axes.margins(x=0.12)
    axes.spines["left"].set_color(FAINT)
    _name_solids(figure, axes, rows, len(TIMED))
    return figure


def methods_figure(results: Results) -> Figure:
    """Median, least and greatest wall time of every method on every solid, logarithmic (Fig. 11).

    Further rivals are in the table alone.
    """
    methods = results.table("methods")
    keys = {column.key for column in methods.columns}
    timed = [name for name in METHOD_COLOURS if name in keys]
    figure, axes = plt.subplots(figsize=(7.6, 1.1 + 1.5 * len(methods.rows)))
    for name, height, at, rows in _bars(timed, methods.rows):
        below = [row[name] - row[f"{name}{MIN}"] for row in rows]
        above = [row[f"{name}{MAX}"] - row[name] for row in rows]
        axes.barh(
            at,
            [row[name] for row in rows],
            height,
            xerr=[below, above],
            color=METHOD_COLOURS[name],
            error_kw={"elinewidth": 0.9, "ecolor": INK},
            label=METHODS[name],
        )
    axes.set_xscale("log")
    _name_solids(figure, axes, methods.rows, 4 if timed else 0)
    return figure


def _bars(names: Sequence[str], rows: list[Row]) -> Iterator[tuple[str, float, list[float], Any]]:
    """Names, each with the height of its bars, their places and the rows that have it."""
    room = 0.8 / max(len(names), 1)
    for index, name in enumerate(names):
        there = [number for number, row in enumerate(rows) if row.get(name) is not None]
        at = [number - 0.4 + (index + 0.5) * room for number in there]
        yield name, 0.86 * room, at, [rows[number] for number in there]


def _name_solids(figure: Figure, axes: Any, rows: list[Row], columns: int) -> None:
    named_rows(axes, [plain(row["title"]).replace(", ", "\n") for row in rows])
    axes.set_xlabel("wall time [s]")
    if columns:
        figure.legend(loc="outside upper left", ncols=columns, columnspacing=1.2)
