"""The figures as one HTML page that carries its plots, tables and style."""

from __future__ import annotations

from typing import Any

from markupsafe import Markup

from workflow.figures.results import Figures, present, without
from workflow.figures.tables import BUILDERS
from workflow.report.convergence_tables import convergence_sentences
from workflow.report.page import inline, page_template
from workflow.report.scaling_tables import assumptions
from workflow.report.table import read_table


def render(figures: Figures) -> str:
    """Build the page from tables and plots; nothing is computed anew."""
    tables = {name: read_table(figures.folder / "tables" / f"{name}.json") for name in BUILDERS}
    return page_template("figures/page.html.j2").render(
        title="The paper’s figures",
        config=figures.config["figures"],
        tables=tables,
        without=without(figures.config),
        sentences=convergence_sentences(tables["convergence"]),
        times=_plot(figures, "times"),
        convergence=_plots(figures, "convergence"),
        scaling=_plots(figures, "scaling"),
        assumptions=assumptions(figures.scaling),
    )


def _plots(figures: Figures, part: str) -> list[dict[str, Any]]:
    return [
        {"name": name, "title": figures.titles[name], "plot": _plot(figures, f"{name}-{part}")}
        for name in present(figures.config, part)
    ]


def _plot(figures: Figures, name: str) -> Markup:
    return inline(figures.folder / "figures" / f"{name}.svg")
