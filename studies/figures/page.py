"""The figures as one page."""

from __future__ import annotations

from studies.base.page import inline, rendered
from studies.base.table import Table
from studies.figures.results import Figures
from workflow.report.convergence_tables import convergence_sentences
from workflow.report.page import plots
from workflow.report.scaling_tables import assumptions


def page(figures: Figures, tables: dict[str, Table]) -> str:
    """Build the page from tables and plots; nothing is computed anew."""
    return rendered(
        "studies/figures/page.html.j2",
        title="The paper’s figures",
        config=figures.part,
        tables=tables,
        without=figures.without,
        sentences=convergence_sentences(tables["convergence"]),
        times=inline(figures.figure("times.svg")),
        convergence=plots(figures, "convergence", figures.convergence),
        scaling=plots(figures, "scaling", figures.scaling),
        assumptions=assumptions(figures),
    )
