"""The figures as one page."""

from __future__ import annotations

from workflow.studies.base.page import inline, rendered
from workflow.studies.base.table import Table
from workflow.studies.figures.results import Figures
from workflow.studies.report.convergence_tables import convergence_sentences
from workflow.studies.report.page import plots
from workflow.studies.report.scaling_tables import assumptions


def page(figures: Figures, tables: dict[str, Table]) -> str:
    """Build the page from tables and plots; nothing is computed anew."""
    return rendered(
        "figures/page.html.j2",
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
