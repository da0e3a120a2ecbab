"""All tables of the study, by name."""

from __future__ import annotations

from collections.abc import Callable

from workflow.report.table import Table
from workflow.study import errors_tables, evidence_tables, forest_tables, goals_tables
from workflow.study.cases import Study

BUILDERS: dict[str, Callable[[Study], Table]] = {
    "summary": errors_tables.summary,
    "summary-all": errors_tables.summary_all,
    "goals": goals_tables.goals,
    "goal-cases": goals_tables.goal_cases,
    "forest": forest_tables.forest,
    "errors": errors_tables.errors,
    "truths": evidence_tables.truths,
    "objectives": evidence_tables.objectives,
    "materials": evidence_tables.materials,
    "provenance": evidence_tables.provenance,
}


def build_tables(study: Study) -> list[Table]:
    """Build every table of a study."""
    return [build(study) for build in BUILDERS.values()]
