"""The columns that say which solid, resolution and material a row is about."""

from __future__ import annotations

from typing import Any

from workflow.report.table import Column
from workflow.study.cases import Case, Study

IDENTITY = (
    Column("model", "Model", shown=False),
    Column("title", "Solid"),
    Column("resolution", "Resolution", "count"),
    Column("material", "Material"),
)


def identity(study: Study, case: Case) -> dict[str, Any]:
    """Values of the `IDENTITY` columns."""
    return {
        "model": case.solid,
        "title": study.title(case.solid),
        "resolution": case.resolution,
        "material": case.material,
    }


def label(study: Study, case: Case) -> str:
    """A case in a few words."""
    return f"{study.title(case.solid)} {case.resolution}, {case.material}"
