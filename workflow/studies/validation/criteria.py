"""What a spectrum has to satisfy to be trusted, and whether it does."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from carillon.fem.model import RIGID_MODES
from solver.files.modes_file import frequencies
from solver.studies.comparison import AUDIBLE_FIRST, AUDIBLE_LAST
from workflow.studies.base.numbers import show
from workflow.studies.validation.evidence import COARSENED, SOLVED, Evidence
from workflow.variants import TRUTH

GROUPS = {
    TRUTH: "Is the ground truth true?",
    SOLVED: "Does the fast solver find the same spectrum?",
    COARSENED: "Is the coarsened solid close enough?",
}
"""The three questions, by the variant that each is about."""


@dataclass(frozen=True)
class Criterion:
    """One requirement.

    Attributes
    ----------
    group : variant that is judged, see `GROUPS`.
    key : name within the group.
    label : what is measured.
    found, limit : values; None if nothing was found.
    kind : how both are shown, see `workflow.studies.base.numbers.show`.
    exact : whether the limit must be hit; otherwise it must not be passed.
    why : why it matters, in one sentence.
    source : file below the folder of the run, and key in it.
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
    def row(self) -> dict[str, Any]:
        """Row of the table of criteria."""
        relation = "" if self.exact else "≤ "
        return {
            "group": self.group,
            "key": self.key,
            "label": self.label,
            "shown": show(self.found, self.kind),
            "required": relation + show(self.limit, self.kind),
            "verdict": "met" if self.passed else "missed",
            "found": self.found,
            "limit": self.limit,
            "why": self.why,
            "source": self.source,
        }


def judge(evidence: Evidence) -> list[Criterion]:
    """All criteria of a model, group by group."""
    limits = evidence.tolerances
    return [
        *_sound(evidence, TRUTH, limits["truth_residual"]),
        *_solver(evidence),
        *_sound(evidence, SOLVED, limits["residual"]),
        *_coarsening(evidence),
        *_sound(evidence, COARSENED, limits["residual"]),
    ]


def _sound(evidence: Evidence, variant: str, residual: float) -> Iterator[Criterion]:
    """What any set of eigenpairs of its own K and M has to satisfy, found anew by the audit."""
    found = evidence.audit["spectra"][variant]
    source = f"{evidence.file('audit.json')}: spectra.{variant}"
    orthogonality = evidence.tolerances["orthogonality"]
    counted, expected = found["counted"], found["expected"]
    # Without a count there is nothing to find, and what was expected is the limit.
    both = (None, expected) if counted is None else (expected, counted)
    below = show(float(frequencies(np.array(found["counted_below"]))), "hertz")
    for key, label, where, (value, limit), kind, why in (
        (
            "residual",
            "Largest residual |Kx − λMx| / (λ|Mx|)",
            "residual_max",
            (found["residual_max"], residual),
            "small",
            "Each pair must satisfy the equation itself, whatever solver it came from.",
        ),
        (
            "orthogonality",
            "Largest entry of |XᵀMX − I|",
            "orthogonality",
            (found["orthogonality"], orthogonality),
            "small",
            "Otherwise the same mode could be counted twice.",
        ),
        (
            "rigid",
            "Modes of frequency zero",
            "rigid_modes",
            (found["rigid_modes"], RIGID_MODES),
            "count",
            "A free body in one piece has six; more mean a hinge or a loose part.",
        ),
        (
            "counted",
            f"Eigenvalues below {below} Hz, found against counted",
            "counted",
            both,
            "count",
            "The inertia of K − μM counts them without computing any: none is missing.",
        ),
    ):
        exact = kind == "count"
        yield Criterion(variant, key, label, value, limit, kind, why, f"{source}.{where}", exact)


def _solver(evidence: Evidence) -> Iterator[Criterion]:
    found, limits = evidence.compared[SOLVED], evidence.tolerances
    file = f"{evidence.file(SOLVED)}.comparison.json"
    for key, label, value, kind, why, source in (
        (
            "eigenvalue_error",
            "Worst relative error of an eigenvalue",
            found["eigenvalue_relative_error"]["max"],
            "small",
            "The same K and M have one spectrum; this is what the solver adds to the error.",
            f"{file}: eigenvalue_relative_error.max",
        ),
        (
            "subspace_angle",
            "Largest angle between spaces of modes",
            found["subspace_angle_max"],
            "angle",
            "Right frequencies with wrong shapes would sound at wrong places.",
            f"{file}: subspace_angle_max",
        ),
        (
            "response",
            "Error of the motion after a strike",
            evidence.response.responses[SOLVED].difference,
            "small",
            "Frequencies, shapes and amplitudes together decide what is seen and heard.",
            f"{evidence.file('response.h5')}: spectra/{SOLVED}, difference",
        ),
    ):
        yield Criterion(SOLVED, key, label, value, limits[key], kind, why, source)


def _coarsening(evidence: Evidence) -> Iterator[Criterion]:
    found, limits = evidence.compared[COARSENED], evidence.tolerances
    last = min(AUDIBLE_LAST, RIGID_MODES + found["modes_compared"])
    modes = f"modes {AUDIBLE_FIRST}–{last}"
    file = f"{evidence.file(COARSENED)}.comparison.json"
    for key, label, where, why in (
        (
            "frequency_rms",
            f"Rms error of the frequencies of {modes}",
            "frequency_rms_relative_error_7_60",
            "What a mesh of an eighth of the cells costs in pitch, on the whole.",
        ),
        (
            "frequency_worst",
            f"Worst error of a frequency of {modes}",
            "frequency_max_relative_error_7_60",
            "A mean hides a single mode that is far off; 6 % is a semitone.",
        ),
    ):
        source = f"{file}: {where}"
        yield Criterion(COARSENED, key, label, found[where], limits[key], "percent", why, source)
