"""What a spectrum has to satisfy to be trusted, whether it does, and what that means in words."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from carillon.files.yaml_input import read_own_yaml
from solver.files.modes_file import frequencies
from solver.verification.matching import AUDIBLE_LAST
from studies.base.numbers import show
from workflow.report.findings import headline
from workflow.validation import limits
from workflow.validation.distance import distance_in_words
from workflow.validation.evidence import COARSENED, SOLVED, Evidence
from workflow.validation.limits import Worst
from workflow.variants import TRUTH

TEXTS: dict[str, Any] = read_own_yaml(Path(__file__).with_name("criteria.yaml"))
SOLID = "solid"
"""Group of what is asked about the solid itself."""


@dataclass(frozen=True)
class Criterion:
    """One requirement."""

    group: str
    """Variant that is judged."""
    key: str
    """Name within the group."""
    label: str
    """What is measured."""
    found: float | None
    limit: float
    """Values; None if nothing was found."""
    kind: str
    """How both are shown, see `studies.base.numbers.show`."""
    why: str
    """Why it matters, in one sentence."""
    source: str
    """File below the folder of the run, and key in it."""
    missed: str = ""
    """What it means if it is missed; empty if the spectrum is wrong then."""
    exact: bool = False
    """Whether the limit must be hit; otherwise it must not be passed."""
    allowed: float | None = None
    """What the tolerance of the run allows; None where the limit itself says what is wrong."""

    @property
    def passed(self) -> bool:
        """Whether it is satisfied; what was not found, or is not a number, does not pass."""
        if self.found is None:
            return False
        return self.found == self.limit if self.exact else self.found <= self.limit

    @property
    def wrong(self) -> bool:
        """Whether it shows that the spectrum is wrong, not just less good than was asked for."""
        if self.passed or self.missed or self.found is None:
            return False
        return self.allowed is None or not self.found <= self.allowed

    @property
    def meaning(self) -> str:
        """What it means that it is missed, in one or two sentences, where nothing is wrong."""
        if self.found is None:
            return TEXTS["not_found"][self.key]
        if self.allowed is not None and self.found <= self.allowed:
            return str(TEXTS["tighter"]).format(key=self.key, shown=self.shown)
        return self.missed

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
    return [
        *_spectrum(evidence, TRUTH),
        *_solver(evidence),
        *_spectrum(evidence, SOLVED),
        *(_of_coarsened(evidence) if COARSENED in evidence.shown else ()),
        *_from_solid(evidence),
    ]


def _spectrum(evidence: Evidence, variant: str) -> Iterator[Criterion]:
    audit = evidence.audit["spectra"][variant]
    counted, expected = audit["counted"], audit["expected"]
    values = {
        "residual": limits.residual(evidence, variant),
        "orthogonality": limits.orthogonality(evidence, variant),
        "rigid": Worst(audit["rigid_modes"], evidence.shown[variant].model.rigid_modes),
        # Without a count there is nothing to find, and what was expected is the limit.
        "counted": Worst(None, expected) if counted is None else Worst(expected, counted),
    }
    below = show(float(frequencies(np.array(audit["counted_below"]))), "hertz")
    return _criteria(evidence, "spectrum", variant, values, below=below)


def _solver(evidence: Evidence) -> Iterator[Criterion]:
    values = {
        "eigenvalue_error": limits.eigenvalue_error(evidence),
        "subspace_angle": limits.subspace_angle(evidence),
        "response": limits.response(evidence),
    }
    return _criteria(evidence, "solver", SOLVED, values)


def _of_coarsened(evidence: Evidence) -> list[Criterion]:
    return [*_coarsening(evidence), *_spectrum(evidence, COARSENED)]


def _coarsening(evidence: Evidence) -> Iterator[Criterion]:
    comparison, tolerances = evidence.compared[COARSENED], evidence.tolerances
    last = min(AUDIBLE_LAST, evidence.shown[TRUTH].model.rigid_modes + comparison["modes_compared"])
    rms, worst = (comparison[f"frequency_{name}_relative_error_7_60"] for name in ("rms", "max"))
    limited = {
        "frequency_rms": Worst(rms, tolerances["frequency_rms"]),
        "frequency_worst": Worst(worst, tolerances["frequency_worst"]),
    }
    modes = f"modes {evidence.shown[TRUTH].model.rigid_modes + 1}–{last}"
    return _criteria(evidence, "coarsening", COARSENED, limited, modes=modes)


def _from_solid(evidence: Evidence) -> Iterator[Criterion]:
    """Of what has a limit; the rest is told only."""
    distance = evidence.distance
    values = {f"solid_{key}": abs(distance[key]) if distance else None for key in ("rms", "worst")}
    limited = {
        key: Worst(value, evidence.tolerances[key])
        for key, value in values.items()
        if evidence.tolerances[key] is not None
    }
    rigid = evidence.shown[TRUTH].model.rigid_modes
    first, last = distance.get("modes", (rigid + 1, AUDIBLE_LAST))
    return _criteria(evidence, SOLID, SOLID, limited, modes=f"modes {first}–{last}")


def _criteria(
    evidence: Evidence, part: str, variant: str, values: dict[str, Worst], **names: str
) -> Iterator[Criterion]:
    names |= {
        "variant": variant,
        "audit": evidence.file("audit.json"),
        "comparison": evidence.file("comparisons.json"),
        "response": evidence.file("response.h5"),
        "solved": evidence.file(f"{SOLVED}.h5"),
        "truth": evidence.file(f"{TRUTH}.h5"),
    }
    for key, each in values.items():
        filled = names | {"where": each.where}
        texts = {name: text.format(**filled) for name, text in TEXTS[part][key].items()}
        yield Criterion(
            variant,
            key,
            found=each.value,
            limit=each.limit,
            allowed=each.allowed,
            exact=texts["kind"] == "count",
            missed=TEXTS["groups"][variant].get("missed", {}).get(key, "").strip(),
            **texts,
        )


def verdict(evidence: Evidence) -> dict[str, Any]:
    """Judgement of a model from all of its criteria.

    Returns
    -------
    dict[str, Any]
        Whether it `passed`; the `headline`; titles of the spectra that are `wrong`; `advice` on
        what may be relied on; and the `parts`, one for each group: `title`, `question`, whether it
        `passed` (None if it is told only) and whether it is `wrong`, a `word`, a `sentence` and its
        `criteria`.
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
        "wrong": [part["title"] for part in parts if part["wrong"]],
        "advice": _advice(parts) or TEXTS[trust],
        "parts": parts,
    }


def _advice(parts: list[dict[str, Any]]) -> str:
    """Which spectrum is wrong; or else what it means that criteria are missed, if any are."""
    for part in parts:
        if part["wrong"]:
            return str(part["doubt"])
    return " ".join(dict.fromkeys(meaning for part in parts for meaning in part["meanings"]))


def _part(texts: dict[str, Any], criteria: list[Criterion]) -> dict[str, Any]:
    by_key = {criterion.key: criterion for criterion in criteria}
    sentence = texts["sentence"].format(completeness=_completeness(by_key["counted"]), **by_key)
    wrong = any(criterion.wrong for criterion in criteria)
    judged = _judged(criteria) | {"wrong": wrong, "sentence": sentence}
    word = texts["words"]["wrong" if wrong else judged["passed"]]
    return {**texts, **judged, "word": word}


def _judged(criteria: list[Criterion]) -> dict[str, Any]:
    missed = [criterion for criterion in criteria if not criterion.passed]
    meanings = [criterion.meaning for criterion in missed]
    return {"passed": not missed, "meanings": meanings, "criteria": criteria}


def _solid_part(evidence: Evidence, criteria: list[Criterion]) -> dict[str, Any]:
    texts, words = TEXTS["groups"][SOLID], distance_in_words(evidence)
    judged = _judged(criteria) | {"wrong": False, "sentence": words["told"]}
    word = texts["words"][judged["passed"]] if criteria else words["word"]
    judged["meanings"] = [text.format(**words) for text in judged["meanings"]]
    return {**texts, **judged, "passed": judged["passed"] if criteria else None, "word": word}


def _completeness(counted: Criterion) -> str:
    if counted.found is None:
        return "whether one is missing was not counted, since PETSc here lacks MUMPS"
    if counted.passed:
        return "an independent count finds none missing"
    return f"an independent count finds {int(counted.limit)} where it has {int(counted.found)}"
