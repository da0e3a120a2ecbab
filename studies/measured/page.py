"""The study of measured frequencies as one page."""

from studies.base.page import StudyPage, origins, section
from studies.base.parts import bullets, grid, html, listed, plot, prose
from studies.base.table import Table
from studies.measured.measure import CELLS
from studies.measured.results import MeasuredStudy
from studies.measured.verdict import AGREES, DIFFERS

FIGURE = """Errors of the frequencies, from the lowest on; the grey band is the rms error that the
    data are good for. Errors that both models share are those of data and constants;
    finite cells above the polynomials show their mesh."""


def page(study: MeasuredStudy, tables: dict[str, Table]) -> StudyPage:
    """Build the page from the tables and figures of a study; nothing is computed anew."""
    summary = tables["summary"]
    cells = summary.having({"model": CELLS})
    agree = [row["title"] for row in cells if row.get("verdict") == AGREES]
    differ = [row["title"] for row in cells if row.get("verdict") == DIFFERS]
    counted = html(
        """Finite cells agree with {agree} of {count} solids within what mesh and data
        explain{rest}.""",
        agree=len(agree),
        count=len(cells),
        rest=f", and differ from {', '.join(differ)}" if differ else "",
    )
    problems = [
        html("{title}, {label}: {problem}.", **row) for row in summary.rows if row.get("problem")
    ]
    return StudyPage(
        title="What do real solids say?",
        kicker="measured and published frequencies",
        lede="""Resonances of blocks, cylinders and crystals from the literature, and benchmarks of
            others: how far are computed frequencies off, and is that the mesh’s or the data’s?""",
        sections=[
            section("Verdict", prose(counted, *problems), grid(summary, by="title")),
            section("Errors", plot(study.drawn("errors"), FIGURE, "errors")),
            section("Where the numbers are from", grid(tables["solids"]), menu="Sources"),
            section("Waiting", grid(tables["waiting"])),
            section("Measure yours", prose(*YOURS), bullets(STEPS), id="yours"),
            section(
                "Every frequency",
                listed("All frequencies", grid(tables["frequencies"], by="title")),
                id="frequencies",
            ),
            origins(tables["provenance"]),
        ],
    )


YOURS = (
    html(
        """A solid is one file: its dimensions and constants with their units, the frequencies of
        all elastic modes from the lowest on, null where none was seen, who found the constants and
        from what, and what is cited. A file that is added to
        <span class="file">studies/measured/data</span> is measured with the others; one that lies
        elsewhere is named on the command line."""
    ),
)
STEPS = (
    html(
        """Copy <span class="file">studies/measured/data/steel-cylinder.yaml</span>; shapes and
        their dimensions are functions of <span class="file">studies/measured/shapes.py</span>."""
    ),
    html(
        """<code>carillon study fit-constants mine.yaml</code> finds the constants that the
        frequencies ask for, if the solid is a box, a cylinder or a sphere."""
    ),
    html(
        """<code>carillon study measured --solids mine.yaml</code> tells the errors, those that are
        expected, and the verdict."""
    ),
)
