"""The campaign as one page; pages of the cells lie below it."""

from typing import Any
from urllib.parse import quote

from markupsafe import Markup

from studies.base.page import StudyPage, origins, section
from studies.base.parts import article, bullets, element, facts, grid, html, note, prose
from studies.base.table import Table
from studies.campaign.cells import Cell
from studies.campaign.results import PASSED, Campaign, end_of


def page(study: Campaign, tables: dict[str, Table]) -> StudyPage:
    """Build the page from the tables of a campaign."""
    about = html(
        """A cell computes the {modes:count} lowest modes of a solid with SLEPc, with HCMS + EC and
        on the coarsened mesh, and judges them as <code>carillon validate</code> does. Limits of
        the solvers follow from <code>solver.tolerance</code>, {tolerance:small}; coarsened
        frequencies may be off by {frequency_rms:percent} rms and {frequency_worst:percent} in the
        worst mode. The verdict for programs is in <span class="file">verdict.json</span> and
        <span class="file">junit.xml</span> beside this page.""",
        **study.part | {"tolerance": study.config["solver"]["tolerance"]},
    )
    cells = [_cell(study, *each) for each in zip(study.found, tables["cells"].rows)]
    judgement = f"judgement {'passed' if study.passed else 'failed'}"
    return StudyPage(
        title="Validation of solids, materials, seeds and ranks",
        kicker="campaign",
        lede=f"""{len(cells)} validations: every solid with every material, seed and number of
            ranks. Where does a spectrum go wrong?""",
        sections=[
            section(
                "Verdict",
                element("p", study.headline, class_=judgement),
                note(study.without),
                prose(about),
                grid(tables["solids"]),
            ),
            section("Cells, the worst first", *cells, menu="Cells"),
            section("Table", grid(tables["cells"])),
            origins(tables["provenance"]),
        ],
    )


def _cell(study: Campaign, cell: Cell, row: dict[str, Any]) -> Markup:
    result = study.found[cell]
    passed = end_of(result) == PASSED
    led = ""
    if "page" in result:
        target = quote(f"cells/{cell.path}/{result['page']}")
        led = html('<a href="{}">Page of the cell</a>', target)
    if result["reason"] is not None:
        reason = element("p", result["reason"])
    elif passed:
        reason = html("<p>Nearest to its limit: {what}.</p>", **row)
    else:
        missed = (each for each in result["criteria"] if each["verdict"] == "missed")
        lines = (html("{group}: {label}: {shown}, required {required}", **each) for each in missed)
        reason = element("p", result.get("advice")) + bullets(lines)
    return article(
        None,
        study.label(cell),
        facts(
            element("span", end_of(result), class_="met" if passed else "missed"),
            html("<span>{seconds:seconds}</span>", **result),
            led,
        ),
        reason,
        element("pre", result["command"], class_="config"),
        class_="cell",
    )
