"""Limits that an objective should keep, and whether it does."""

from __future__ import annotations

from dataclasses import dataclass

from workflow.study.cases import Case, Study

NBSP = "\N{NO-BREAK SPACE}"
LABELS = {"rms": "rms", "rms_of_galerkin": "rms over Galerkin’s", "worst": "worst frequency"}


@dataclass(frozen=True)
class Goal:
    """One limit on modes 7..60, see `objectives.goals` in the configuration."""

    model: str
    quantity: str
    limit: float
    resolutions: list[int] | None
    materials: list[str] | None

    def cases(self, study: Study) -> list[Case]:
        """Cases of the study that the limit is for."""
        return [
            case
            for case in study.found
            if case.solid == self.model
            and (self.resolutions is None or case.resolution in self.resolutions)
            and (self.materials is None or case.material in self.materials)
        ]

    def value(self, study: Study, case: Case, coarsening: str) -> float:
        """What is to stay below the limit."""
        errors = study.errors(case, coarsening)["audible"]
        if self.quantity == "worst":
            return abs(float(errors["worst"]))
        rms = float(errors["rms"])
        if self.quantity == "rms":
            return rms
        return rms / float(study.errors(case, "galerkin")["audible"]["rms"])

    @property
    def sentence(self) -> str:
        """The goal in a few words."""
        where = self.model.replace("-", " ").capitalize()
        if self.resolutions:
            where += f" {', '.join(map(str, self.resolutions))}"
        return f"{where}: {LABELS[self.quantity]} ≤{NBSP}{100 * self.limit:.3g}{NBSP}%"


@dataclass(frozen=True)
class Verdict:
    """How a coarsening does on a goal: its largest value, and in how many cases it is met."""

    value: float | None
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


def goals_of(study: Study) -> list[Goal]:
    """Goals of the configuration."""
    return [Goal(**goal) for goal in study.config["objectives"]["goals"]]


def judge(study: Study, goal: Goal, coarsening: str) -> Verdict:
    """Verdict on one coarsening."""
    values = [goal.value(study, case, coarsening) for case in goal.cases(study)]
    met = sum(value <= goal.limit for value in values)
    return Verdict(max(values, default=None), met, len(values))


def rms_limits(study: Study, solid: str) -> list[float]:
    """Limits on the rms error of a solid."""
    goals = goals_of(study)
    return [goal.limit for goal in goals if (goal.model, goal.quantity) == (solid, "rms")]
