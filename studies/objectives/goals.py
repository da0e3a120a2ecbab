"""Limits that an objective should keep, and whether it does."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain, starmap

from solver.coarsening.forest import FOREST
from studies.base.cases import Case, case_columns
from studies.base.results import spelt
from studies.base.table import Column, Row, hidden, table
from studies.objectives.results import Objectives

NBSP = "\N{NO-BREAK SPACE}"
LABELS = {
    "rms": "rms",
    "rms_of_galerkin": "rms over Galerkin’s",
    "rms_of_fit": "rms of the forests over that of the fit they learned",
    "worst": "worst frequency",
}


@dataclass(frozen=True)
class Goal:
    """One limit on modes 7..60, see `objectives.goals` in the configuration."""

    model: str | None
    quantity: str
    limit: float
    resolutions: list[int] | None
    materials: list[str] | None

    def cases(self, study: Objectives) -> list[Case]:
        """Cases of the study that the limit is for."""
        return [
            case
            for case in study.ratings
            if self.model in (None, case.solid)
            and (self.resolutions is None or case.resolution in self.resolutions)
            and (self.materials is None or case.material in self.materials)
        ]

    def value(self, study: Objectives, case: Case, coarsening: str) -> float | None:
        """What is to stay below the limit; None if the goal is not about this coarsening."""
        if self.quantity == "worst":
            return abs(float(study.errors(case, coarsening)["audible"]["worst"]))
        if self.quantity == "rms":
            return study.rms(case, coarsening)
        if self.quantity == "rms_of_galerkin":
            return study.rms(case, coarsening) / study.rms(case, "galerkin")
        return study.forest_over_fit(case) if coarsening == FOREST else None

    @property
    def sentence(self) -> str:
        """The goal in a few words."""
        where = spelt(self.model) if self.model else "All solids"
        if self.resolutions:
            where += f" {', '.join(map(str, self.resolutions))}"
        return f"{where}: {LABELS[self.quantity]} ≤{NBSP}{100 * self.limit:.3g}{NBSP}%"


@dataclass(frozen=True)
class Verdict:
    """How a coarsening does on a goal: the largest value, where, and how many cases meet it."""

    value: float | None
    where: str | None
    met: int
    cases: int

    @property
    def passed(self) -> bool:
        """Whether the limit is kept in every case, of which there is one at least."""
        return 0 < self.cases == self.met

    def __str__(self) -> str:
        if self.cases == 0:
            return "not studied"
        return "met" if self.passed else f"missed, {self.met}{NBSP}of{NBSP}{self.cases} met"


def goals_of(study: Objectives) -> list[Goal]:
    """Goals of the configuration."""
    return [Goal(**goal) for goal in study.part["goals"]]


def judge(study: Objectives, goal: Goal, coarsening: str) -> Verdict:
    """Verdict on one coarsening."""
    pairs = ((goal.value(study, case, coarsening), case) for case in goal.cases(study))
    values = {case: value for value, case in pairs if value is not None}
    if not values:
        return Verdict(None, None, 0, 0)
    worst = max(values, key=values.__getitem__)
    met = sum(value <= goal.limit for value in values.values())
    return Verdict(values[worst], study.label(worst), met, len(values))


def rms_limits(study: Objectives, solid: str) -> list[float]:
    """Limits on the rms error of a solid."""
    goals = goals_of(study)
    return [goal.limit for goal in goals if goal.quantity == "rms" and goal.model in (None, solid)]


def _columns(index: int, goal: Goal) -> tuple[Column, ...]:
    key = f"goal{index}"
    where = Column if goal.model is None else hidden
    return (
        Column(f"{key}_value", goal.sentence, "percent"),
        Column(key, "verdict"),
        where(f"{key}_where", "worst at"),
    )


@table(
    Column("coarsening", "Objective"),
    Column("met", "Goals met"),
    lambda study: chain.from_iterable(starmap(_columns, enumerate(goals_of(study)))),
)
def goals(study: Objectives) -> Iterator[Row]:
    """Goals on modes 7–{last[audible]}: the largest value among the cases that a goal is about, and
    whether all of them keep the limit. A goal of the forests says nothing of the fits."""
    for coarsening in study.coarsenings:
        verdicts = [(goal, judge(study, goal, coarsening)) for goal in goals_of(study)]
        judged = [verdict for _, verdict in verdicts if verdict.cases]
        passed = sum(verdict.passed for verdict in judged)
        row: Row = {"coarsening": coarsening, "met": f"{passed} of {len(judged)}"}
        for index, (goal, verdict) in enumerate(verdicts):
            about = verdict.cases or not goal.cases(study)
            row |= {
                f"goal{index}_value": verdict.value,
                f"goal{index}": str(verdict) if about else None,
                f"goal{index}_where": verdict.where,
            }
        yield row


@table(
    Column("goal", "Goal"),
    case_columns(),
    Column("limit", "Limit", "percent"),
    lambda study: [Column(name, name, "percent") for name in study.coarsenings],
)
def goal_cases(study: Objectives) -> Iterator[Row]:
    """Every case that a goal is about: the limit, and the value of each objective."""
    for goal in goals_of(study):
        for case in goal.cases(study):
            values = {name: goal.value(study, case, name) for name in study.coarsenings}
            about = {"goal": goal.sentence, "limit": goal.limit}
            yield {**about, **study.identity(case), **values}
