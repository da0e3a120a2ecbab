"""The campaign as one page."""

from __future__ import annotations

from typing import Any

from studies.base.page import rendered
from studies.base.table import Table
from studies.campaign.results import PASSED, Campaign, end_of


def page(study: Campaign, tables: dict[str, Table]) -> str:
    """Build the page from the tables of a campaign; pages of the cells lie below it."""
    return rendered(
        "studies/campaign/page.html.j2",
        title="Validation of solids, materials, seeds and ranks",
        config=study.config,
        part=study.part,
        passed=study.passed,
        headline=study.headline,
        without=study.without,
        cells=[_cell(study, row) for row in tables["cells"].rows],
        tables=tables,
    )


def _cell(study: Campaign, row: dict[str, Any]) -> dict[str, Any]:
    """What the page says of a cell."""
    key = (row["model"], row["material"], row["seed"], row["ranks"])
    cell = next(
        each for each in study.found if (each.solid, each.material, each.seed, each.ranks) == key
    )
    result = study.found[cell]
    missed = [each for each in result["criteria"] if each["verdict"] == "missed"]
    return {
        "label": study.label(cell),
        "end": end_of(result),
        "passed": end_of(result) == PASSED,
        "reason": result["reason"],
        "advice": result.get("advice"),
        "missed": missed,
        "what": row["what"],
        "command": result["command"],
        "seconds": result["seconds"],
        "page": f"cells/{cell.path}/{result['page']}" if "page" in result else None,
    }
