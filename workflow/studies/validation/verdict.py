"""What the criteria mean, in words."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from workflow.studies.report.findings import headline
from workflow.studies.validation.criteria import TEXTS, Criterion


def verdict(criteria: Sequence[Criterion]) -> dict[str, Any]:
    """Judgement of a model from all of its criteria.

    Returns
    -------
    dict[str, Any]
        Whether it `passed`; the `headline`; `advice` on what may be relied on; and the `parts`, one
        for each group: `title`, `question`, whether it `passed`, a `word`, a `sentence` and its
        `criteria`.
    """
    parts = [
        _part(texts, [criterion for criterion in criteria if criterion.group == group])
        for group, texts in TEXTS["groups"].items()
    ]
    missed = sum(not criterion.passed for criterion in criteria)
    return {
        "passed": missed == 0,
        "headline": headline(len(criteria), missed),
        "advice": next((part["doubt"] for part in parts if not part["passed"]), TEXTS["trust"]),
        "parts": parts,
    }


def _part(texts: dict[str, Any], criteria: list[Criterion]) -> dict[str, Any]:
    passed = all(criterion.passed for criterion in criteria)
    by_key = {criterion.key: criterion for criterion in criteria}
    sentence = texts["sentence"].format(completeness=_completeness(by_key["counted"]), **by_key)
    judged = {"passed": passed, "word": texts["words"][passed], "sentence": sentence}
    return {**texts, **judged, "criteria": criteria}


def _completeness(counted: Criterion) -> str:
    if counted.found is None:
        return "whether one is missing was not counted, since PETSc here lacks MUMPS"
    if counted.passed:
        return "an independent count finds none missing"
    return f"an independent count finds {int(counted.limit)} where it has {int(counted.found)}"
