"""What a spectrum has to satisfy to be trusted, whether it does, and what that means in words."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from carillon.documents import read_own_yaml
from carillon.fem.model import RIGID_MODES
from solver.files.modes_file import frequencies
from solver.studies.comparison import AUDIBLE_FIRST, AUDIBLE_LAST
from workflow.studies.base.numbers import show
from workflow.studies.report.findings import headline
from workflow.studies.validation.distance import distance_in_words
from workflow.studies.validation.evidence import COARSENED, SOLVED, Evidence
from workflow.variants import TRUTH

TEXTS: dict[str, Any] = read_own_yaml(Path(__file__).with_name("criteria.yaml"))
SOLID = "solid"
"""Group of what is asked about the solid itself."""
Limited = tuple[float | None, float]
"""What was found, and its limit."""


@dataclass(frozen=True)
class Criterion:
    """One requirement.

    Attributes
    ----------
    group
        Variant that is judged.
    key
        Name within the group.
    label
        What is measured.
    found, limit
        Values; None if nothing was found.
    kind
        How both are shown, see `workflow.studies.base.numbers.show`.
    exact
        Whether the limit must be hit; otherwise it must not be passed.
    why
        Why it matters, in one sentence.
    source
        File below the folder of the run, and key in it.
    """

    group: str
    key: str
    label: str
    found: float | None
    limit: float
    kind: str
    why: str
    source: str
    exact: bool = False

    @property
    def passed(self) -> bool:
        """Whether it is satisfied; what was not found, or is not a number, does not pass."""
        if self.found is None:
            return False
        return self.found == self.limit if self.exact else self.found <= self.limit

    @property
    def shown(self) -> str:
        """What was found, for people."""
        return show(self.found, self.kind)

    @property
    def required(self) -> str:
        """The limit, for people."""
        return ("" if self.exact else "≤ ") + show(self.limit, self.kind)

    @property
    def row(self) -> dict[str, Any]:
        """Row of the table of criteria."""
        keys = ("group", "key", "label", "shown", "required", "found", "limit", "why", "source")
        verdict = "met" if self.passed else "missed"
        return {**{name: getattr(self, name) for name in keys}, "verdict": verdict}


def judge(evidence: Evidence) -> list[Criterion]:
    """All criteria of a model, group by group."""
    limits = evidence.tolerances
    return [
        *_spectrum(evidence, TRUTH, limits["truth_residual"]),
        *_solver(evidence),
        *_spectrum(evidence, SOLVED, limits["residual"]),
        *(_of_coarsened(evidence) if COARSENED in evidence.shown else ()),
        *_from_solid(evidence),
    ]


def _spectrum(evidence: Evidence, variant: str, residual: float) -> Iterator[Criterion]:
    audit = evidence.audit["spectra"][variant]
    counted, expected = audit["counted"], audit["expected"]
    values = {
        "residual": (audit["residual_max"], residual),
        "orthogonality": (audit["orthogonality"], evidence.tolerances["orthogonality"]),
        "rigid": (audit["rigid_modes"], RIGID_MODES),
        # Without a count there is nothing to find, and what was expected is the limit.
        "counted": (None, expected) if counted is None else (expected, counted),
    }
    below = show(float(frequencies(np.array(audit["counted_below"]))), "hertz")
    return _criteria(evidence, "spectrum", variant, values, below=below)


def _solver(evidence: Evidence) -> Iterator[Criterion]:
    comparison, limits = evidence.compared[SOLVED], evidence.tolerances
    values = {
        "eigenvalue_error": comparison["eigenvalue_relative_error"]["max"],
        "subspace_angle": comparison["subspace_angle_max"],
        "response": evidence.response.responses[SOLVED].difference,
    }
    limited = {key: (value, limits[key]) for key, value in values.items()}
    return _criteria(evidence, "solver", SOLVED, limited)


def _of_coarsened(evidence: Evidence) -> list[Criterion]:
    residual = evidence.tolerances["residual"]
    return [*_coarsening(evidence), *_spectrum(evidence, COARSENED, residual)]


def _coarsening(evidence: Evidence) -> Iterator[Criterion]:
    comparison, limits = evidence.compared[COARSENED], evidence.tolerances
    last = min(AUDIBLE_LAST, RIGID_MODES + comparison["modes_compared"])
    rms, worst = (comparison[f"frequency_{name}_relative_error_7_60"] for name in ("rms", "max"))
    limited = {
        "frequency_rms": (rms, limits["frequency_rms"]),
        "frequency_worst": (worst, limits["frequency_worst"]),
    }
    modes = f"modes {AUDIBLE_FIRST}–{last}"
    return _criteria(evidence, "coarsening", COARSENED, limited, modes=modes)


def _from_solid(evidence: Evidence) -> Iterator[Criterion]:
    """Of what has a limit; the rest is told only."""
    distance = evidence.distance
    found = {f"solid_{key}": abs(distance[key]) if distance else None for key in ("rms", "worst")}
    limited = {
        key: (value, evidence.tolerances[key])
        for key, value in found.items()
        if evidence.tolerances[key] is not None
    }
    first, last = distance.get("modes", (AUDIBLE_FIRST, AUDIBLE_LAST))
    return _criteria(evidence, SOLID, SOLID, limited, modes=f"modes {first}–{last}")


def _criteria(
    evidence: Evidence, part: str, variant: str, values: dict[str, Limited], **names: str
) -> Iterator[Criterion]:
    """Criteria of a part of the texts, whose labels may hold the `names`."""
    names |= {
        "variant": variant,
        "audit": evidence.file("audit.json"),
        "comparison": evidence.file(f"{variant}.comparison.json"),
        "response": evidence.file("response.h5"),
        "solved": evidence.file(f"{SOLVED}.h5"),
    }
    for key, (value, limit) in values.items():
        texts = {name: text.format(**names) for name, text in TEXTS[part][key].items()}
        exact = texts["kind"] == "count"
        yield Criterion(variant, key, found=value, limit=limit, exact=exact, **texts)


def verdict(evidence: Evidence) -> dict[str, Any]:
    """Judgement of a model from all of its criteria.

    Returns
    -------
    dict[str, Any]
        Whether it `passed`; the `headline`; `advice` on what may be relied on; and the `parts`, one
        for each group: `title`, `question`, whether it `passed` (None if it is told only), a
        `word`, a `sentence` and its `criteria`.
    """
    criteria = judge(evidence)
    judged = {criterion.group for criterion in criteria}
    parts = [
        *(
            _part(texts, [criterion for criterion in criteria if criterion.group == group])
            for group, texts in TEXTS["groups"].items()
            if group in judged - {SOLID}
        ),
        _solid_part(evidence, [criterion for criterion in criteria if criterion.group == SOLID]),
    ]
    trust = "trust" if COARSENED in judged else "trust_fine"
    missed = sum(not criterion.passed for criterion in criteria)
    return {
        "passed": missed == 0,
        "headline": headline(len(criteria), missed),
        "advice": next((part["doubt"] for part in parts if part["passed"] is False), TEXTS[trust]),
        "parts": parts,
    }


def _part(texts: dict[str, Any], criteria: list[Criterion]) -> dict[str, Any]:
    passed = all(criterion.passed for criterion in criteria)
    by_key = {criterion.key: criterion for criterion in criteria}
    sentence = texts["sentence"].format(completeness=_completeness(by_key["counted"]), **by_key)
    judged = {"passed": passed, "word": texts["words"][passed], "sentence": sentence}
    return {**texts, **judged, "criteria": criteria}


def _solid_part(evidence: Evidence, criteria: list[Criterion]) -> dict[str, Any]:
    texts, words = TEXTS["groups"][SOLID], distance_in_words(evidence)
    passed = all(criterion.passed for criterion in criteria) if criteria else None
    word = words["word"] if passed is None else texts["words"][passed]
    judged = {"passed": passed, "word": word, "sentence": words["told"], "criteria": criteria}
    return {**texts, **judged, "doubt": texts["doubt"].format(**words)}


def _completeness(counted: Criterion) -> str:
    if counted.found is None:
        return "whether one is missing was not counted, since PETSc here lacks MUMPS"
    if counted.passed:
        return "an independent count finds none missing"
    return f"an independent count finds {int(counted.limit)} where it has {int(counted.found)}"
