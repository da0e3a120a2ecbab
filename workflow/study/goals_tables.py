"""Tables of the goals that objectives meet and miss."""

from __future__ import annotations

from typing import Any

from workflow.report.table import Column, Table
from workflow.study.cases import Study
from workflow.study.errors_tables import FIRST
from workflow.study.goals import goals_of, judge
from workflow.study.identity import IDENTITY, identity


def goals(study: Study) -> Table:
    """Goals met and missed by every objective."""
    wanted = goals_of(study)
    columns = [Column("coarsening", "Objective"), Column("met", "Goals met")]
    for index, goal in enumerate(wanted):
        columns.append(Column(f"goal{index}_value", goal.sentence, "percent"))
        columns.append(Column(f"goal{index}", "verdict"))
        columns.append(Column(f"goal{index}_where", "worst at", shown=goal.model is None))
    return Table(
        "goals",
        f"Goals on modes {FIRST}–{study.last_audible}: the largest value among the cases that a "
        "goal is about, and whether all of them keep the limit. A goal of the forests says nothing "
        "of the fits.",
        columns,
        [_goals_row(study, coarsening) for coarsening in study.coarsenings],
    )


def _goals_row(study: Study, coarsening: str) -> dict[str, Any]:
    verdicts = [judge(study, goal, coarsening) for goal in goals_of(study)]
    judged = [verdict for verdict in verdicts if verdict.cases]
    row: dict[str, Any] = {
        "coarsening": coarsening,
        "met": f"{sum(verdict.passed for verdict in judged)} of {len(judged)}",
    }
    for index, (goal, verdict) in enumerate(zip(goals_of(study), verdicts)):
        about = verdict.cases or not goal.cases(study)
        row |= {
            f"goal{index}_value": verdict.value,
            f"goal{index}": str(verdict) if about else None,
        }
        row[f"goal{index}_where"] = verdict.where
    return row


def goal_cases(study: Study) -> Table:
    """Every case of every goal."""
    columns = [Column("goal", "Goal"), *IDENTITY, Column("limit", "Limit", "percent")]
    return Table(
        "goal-cases",
        "Every case that a goal is about: the limit, and the value of each objective.",
        columns + [Column(name, name, "percent") for name in study.coarsenings],
        [
            {
                "goal": goal.sentence,
                **identity(study, case),
                "limit": goal.limit,
                **{name: goal.value(study, case, name) for name in study.coarsenings},
            }
            for goal in goals_of(study)
            for case in goal.cases(study)
        ],
    )
