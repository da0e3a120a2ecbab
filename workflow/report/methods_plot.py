"""Figure of all methods' wall times with their spread (Fig. 11)."""

from __future__ import annotations

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from studies.base.colours import COLOURS, FAINT, INK, MUTED
from studies.base.results import Results
from studies.base.style import named_rows, plain
from studies.base.table import MAX, MIN
from workflow.report.methods_tables import METHODS

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


def methods_figure(results: Results) -> Figure:
    """Median, least and greatest wall time of every method on every solid, logarithmic.

    Further rivals are in the table alone.
    """
    methods = results.table("methods")
    keys = {column.key for column in methods.columns}
    timed = [name for name in METHOD_COLOURS if name in keys]
    height = 0.8 / max(len(timed), 1)
    figure, axes = plt.subplots(figsize=(7.6, 1.1 + 1.5 * len(methods.rows)))
    for index, name in enumerate(timed):
        rows = [
            (number - 0.4 + (index + 0.5) * height, row)
            for number, row in enumerate(methods.rows)
            if row.get(name) is not None
        ]
        medians = [row[name] for _, row in rows]
        below = [row[name] - row[f"{name}{MIN}"] for _, row in rows]
        above = [row[f"{name}{MAX}"] - row[name] for _, row in rows]
        axes.barh(
            [at for at, _ in rows],
            medians,
            0.86 * height,
            xerr=[below, above],
            color=METHOD_COLOURS[name],
            error_kw={"elinewidth": 0.9, "ecolor": INK},
            label=METHODS[name],
        )
    axes.set_xscale("log")
    named_rows(axes, [plain(row["title"]).replace(", ", "\n") for row in methods.rows])
    axes.set_xlabel("wall time [s]")
    if timed:
        figure.legend(loc="outside upper left", ncols=4, columnspacing=1.2)
    return figure
