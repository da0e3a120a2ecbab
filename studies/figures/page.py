"""The figures as one page."""

from studies.base.page import StudyPage, origins, section
from studies.base.parts import grid, plot, prose
from studies.base.results import Results
from studies.base.table import Table
from studies.figures.study import MEASURES
from workflow.report.page import convergence_plots, modelled, scaling_plots


class Figures(Results):
    """The folder of the figures; solids whose mesh does not exist are left out."""

    section = "figures"
    measures = MEASURES


def page(figures: Figures, tables: dict[str, Table]) -> StudyPage:
    """Build the page from tables and plots; nothing is computed anew."""
    times = "Medians of the table above, with least and greatest; the axis is logarithmic."
    return StudyPage(
        title="The paper’s figures",
        kicker="reproduction of the tables",
        lede="""All methods on the same solids, machine and cores; how fast corrections converge
            from which start; and how the solver scales over ranks.""",
        sections=[
            section(
                "Times",
                prose(figures.without),
                grid(tables["methods"]),
                plot(figures.drawn("times"), times, "times"),
                grid(tables["ratios"], by="model"),
                grid(tables["spreads"], by="model"),
                menu="Times (Fig. 11)",
                id="times",
            ),
            section(
                "Convergence of the error correction",
                convergence_plots(figures, tables["convergence"], figures.part["steps"]),
                grid(tables["convergence"], by="start"),
                menu="Convergence (Fig. 10)",
                id="convergence",
            ),
            section(
                "Scaling over ranks",
                scaling_plots(figures),
                modelled(figures),
                grid(tables["scaling"], by="kind"),
                menu="Scaling",
            ),
            origins(tables["provenance"]),
        ],
    )
