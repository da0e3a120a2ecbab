"""What a spectrum has to satisfy to be trusted, and whether it does."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from carillon.fem.model import RIGID_MODES
from solver.files.modes_file import frequencies
from solver.studies.comparison import AUDIBLE_FIRST, AUDIBLE_LAST
from workflow.report.numbers import show
from workflow.validate.evidence import COARSENED, SOLVED, Evidence
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
    kind : how both are shown, see `workflow.report.numbers.show`.
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


def _sound(evidence: Evidence, variant: str, residual: float) -> list[Criterion]:
    """What any set of eigenpairs of its own K and M has to satisfy, found anew by the audit."""
    found = evidence.audits[variant]
    source = f"{evidence.file('audit.json')}: spectra.{variant}"
    return [
        Criterion(
            variant,
            "residual",
            "Largest residual |Kx − λMx| / (λ|Mx|)",
            found["residual_max"],
            residual,
            "small",
            "Each pair must satisfy the equation itself, whatever solver it came from.",
            f"{source}.residual_max",
        ),
        Criterion(
            variant,
            "orthogonality",
            "Largest entry of |XᵀMX − I|",
            found["orthogonality"],
            evidence.tolerances["orthogonality"],
            "small",
            "Otherwise the same mode could be counted twice.",
            f"{source}.orthogonality",
        ),
        Criterion(
            variant,
            "rigid",
            "Modes of frequency zero",
            found["rigid_modes"],
            RIGID_MODES,
            "count",
            "A free body in one piece has six; more mean a hinge or a loose part.",
            f"{source}.rigid_modes",
            exact=True,
        ),
        Criterion(
            variant,
            "counted",
            f"Eigenvalues below {_hertz(found['counted_below'])} Hz, found against counted",
            found["expected"] if found["counted"] is not None else None,
            found["counted"] if found["counted"] is not None else found["expected"],
            "count",
            "The inertia of K − μM counts them without computing any: none is missing.",
            f"{source}.counted",
            exact=True,
        ),
    ]


def _solver(evidence: Evidence) -> list[Criterion]:
    found, limits = evidence.comparisons[SOLVED], evidence.tolerances
    source = evidence.file(f"{SOLVED}.comparison.json")
    return [
        Criterion(
            SOLVED,
            "eigenvalue_error",
            "Worst relative error of an eigenvalue",
            found["eigenvalue_relative_error"]["max"],
            limits["eigenvalue_error"],
            "small",
            "The same K and M have one spectrum; this is what the solver adds to the error.",
            f"{source}: eigenvalue_relative_error.max",
        ),
        Criterion(
            SOLVED,
            "subspace_angle",
            "Largest angle between spaces of modes",
            found["subspace_angle_max"],
            limits["subspace_angle"],
            "angle",
            "Right frequencies with wrong shapes would sound at wrong places.",
            f"{source}: subspace_angle_max",
        ),
        Criterion(
            SOLVED,
            "response",
            "Error of the motion after a strike",
            evidence.response.responses[SOLVED].difference,
            limits["response"],
            "small",
            "Frequencies, shapes and amplitudes together decide what is seen and heard.",
            f"{evidence.file('response.h5')}: spectra/{SOLVED}, difference",
        ),
    ]


def _coarsening(evidence: Evidence) -> list[Criterion]:
    found, limits = evidence.comparisons[COARSENED], evidence.tolerances
    source = evidence.file(f"{COARSENED}.comparison.json")
    last = min(AUDIBLE_LAST, RIGID_MODES + found["modes_compared"])
    modes = f"modes {AUDIBLE_FIRST}–{last}"
    return [
        Criterion(
            COARSENED,
            "frequency_rms",
            f"Rms error of the frequencies of {modes}",
            found["frequency_rms_relative_error_7_60"],
            limits["frequency_rms"],
            "percent",
            "What a mesh of an eighth of the cells costs in pitch, on the whole.",
            f"{source}: frequency_rms_relative_error_7_60",
        ),
        Criterion(
            COARSENED,
            "frequency_worst",
            f"Worst error of a frequency of {modes}",
            found["frequency_max_relative_error_7_60"],
            limits["frequency_worst"],
            "percent",
            "A mean hides a single mode that is far off; 6 % is a semitone.",
            f"{source}: frequency_max_relative_error_7_60",
        ),
    ]


def _hertz(eigenvalue: float) -> str:
    return show(float(frequencies(np.array(eigenvalue))), "hertz")
