"""What the criteria mean, in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from workflow.studies.base.numbers import show
from workflow.studies.report.findings import headline
from workflow.studies.validation.criteria import GROUPS, Criterion
from workflow.studies.validation.evidence import COARSENED, SOLVED
from workflow.variants import TRUTH

TITLES = {
    TRUTH: "Ground truth",
    SOLVED: "HCMS + EC",
    COARSENED: "DDFEM* + HCMS + EC",
}


@dataclass(frozen=True)
class Part:
    """Judgement of one of the `GROUPS`.

    Attributes
    ----------
    group, title, question : what is judged.
    passed : whether all of its criteria are met.
    word : the judgement in a word or two.
    sentence : the judgement with its numbers.
    criteria : the criteria, met or not.
    """

    group: str
    title: str
    question: str
    passed: bool
    word: str
    sentence: str
    criteria: list[Criterion]


@dataclass(frozen=True)
class Verdict:
    """Judgement of a model.

    Attributes
    ----------
    passed : whether all criteria are met.
    headline : the judgement in a sentence.
    advice : what may be relied on, in a sentence or two.
    parts : the judgements that it consists of.
    """

    passed: bool
    headline: str
    advice: str
    parts: list[Part]


def verdict(criteria: Sequence[Criterion]) -> Verdict:
    """Judgement from all criteria of a model."""
    parts = [
        _part(group, [criterion for criterion in criteria if criterion.group == group])
        for group in GROUPS
    ]
    missed = sum(not criterion.passed for criterion in criteria)
    return Verdict(missed == 0, headline(len(criteria), missed), _advice(parts), parts)


def _part(group: str, criteria: list[Criterion]) -> Part:
    passed = all(criterion.passed for criterion in criteria)
    words = {
        TRUTH: ("proven", "not proven"),
        SOLVED: ("the same", "not the same"),
        COARSENED: ("close enough", "not close enough"),
    }
    return Part(
        group,
        TITLES[group],
        GROUPS[group],
        passed,
        words[group][0 if passed else 1],
        _sentence(group, {criterion.key: criterion for criterion in criteria}),
        criteria,
    )


def _sentence(group: str, found: dict[str, Criterion]) -> str:
    if group == TRUTH:
        return (
            f"Its modes satisfy the equation to {_shown(found['residual'])}, and "
            f"{_completeness(found['counted'])}."
        )
    if group == SOLVED:
        return (
            f"Relatively, the worst eigenvalue is off by {_shown(found['eigenvalue_error'])} and "
            f"the motion after a strike by {_shown(found['response'])}; the largest angle between "
            f"modes is {_shown(found['subspace_angle'])}."
        )
    return (
        f"Its frequencies are off by {_shown(found['frequency_rms'])} rms "
        f"({found['frequency_rms'].row['required']} is asked for), one by "
        f"{_shown(found['frequency_worst'])} ({found['frequency_worst'].row['required']})."
    )


def _completeness(counted: Criterion) -> str:
    if counted.found is None:
        return "whether one is missing was not counted, since PETSc here lacks MUMPS"
    if counted.passed:
        return "an independent count finds none missing"
    return f"an independent count finds {int(counted.limit)} where it has {int(counted.found)}"


def _advice(parts: list[Part]) -> str:
    truth, solved, coarsened = (part.passed for part in parts)
    if not truth:
        return (
            "The ground truth itself is in doubt, so nothing on this page can be relied on. Find "
            "out first what the criteria that it misses have found."
        )
    if not solved:
        return (
            "Do not rely on HCMS + EC for this solid and material: it solves the same equations as "
            "the ground truth and should have found the same. Use --method slepc, and report it."
        )
    if not coarsened:
        return (
            "On the fine mesh HCMS + EC can be relied on as on the ground truth. Do not rely on "
            "the coarsened solid within these limits; use the fine mesh, or a finer one to coarsen."
        )
    return (
        "On the fine mesh HCMS + EC can be relied on as on the ground truth. The coarsened solid "
        "is an approximation; it errs by the amounts below, within the limits that were set."
    )


def _shown(criterion: Criterion) -> str:
    return show(criterion.found, criterion.kind)
