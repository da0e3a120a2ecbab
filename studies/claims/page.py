"""The claims as one page."""

from __future__ import annotations

from studies.base.page import picture_uri, rendered
from studies.base.table import Table
from studies.claims.findings import IN_PART, LESS, NOT, REPRODUCED
from studies.claims.results import Claims
from studies.claims.tables import NO_MESH


def page(claims: Claims, tables: dict[str, Table]) -> str:
    """Build the page from its tables; nothing is computed anew."""
    verdicts = [row["verdict"] for row in tables["claims"].rows]
    return rendered(
        "studies/claims/page.html.j2",
        title="The paper’s claims",
        tables=tables,
        counts={verdict: verdicts.count(verdict) for verdict in (REPRODUCED, LESS, IN_PART, NOT)},
        absent=[row["solid"] for row in tables["solids"].rows if row["note"] == NO_MESH],
        scene=claims.scene,
        picture=picture_uri(claims.scene_picture) if claims.scene_picture else None,
    )
