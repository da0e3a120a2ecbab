"""Audits of modes files: the evidence that a file holds, and what is wrong with it, in sentences.

The limits follow from a tolerance, see docs/explanation/trust.md.
"""

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from carillon.errors import UserError
from carillon.files.paths import by_stem
from carillon.notebook.card import card, html_or_text, named_values
from solver.correction.criteria import EIGENVALUE_TOLERANCE
from solver.files.modes_file import ModesFile, frequencies, read_modes
from solver.verification.allowance import (
    ACCEPTED,
    accepted_errors,
    orthogonality_limit,
    residual_limits,
)
from solver.verification.evidence import ModesEvidence, measure_evidence

ROUNDING = 1e-9
"""Largest relative difference by rounding between a frequency and that of its eigenvalue."""


@dataclass(frozen=True)
class Audit(ModesEvidence):
    """Evidence, and the faults that follow from it.

    The `faults` say what is wrong, a sentence each.
    """

    faults: list[str]

    def __repr__(self) -> str:
        said = "; ".join(self.faults) or "no fault"
        return f"<Audit of {self.modes} modes of {self.unknowns:,} unknowns: {said}>"

    def _repr_html_(self) -> str:
        return html_or_text(self, self._html)

    def _html(self) -> str:
        counted = "unknown" if self.counted is None else f"{self.counted}"
        rows = [
            ("modes counted by inertia", counted),
            ("modes that are there below that value", f"{self.expected}"),
            ("rigid modes", f"{self.rigid_modes}"),
            ("departure from orthogonality", f"{self.orthogonality:.1e}"),
            ("residual, largest", f"{self.residual_max:.1e}"),
            ("residual in energy, largest", f"{max(self.energy_residuals, default=0.0):.1e}"),
            ("mass", f"{self.mass:.4g} kg"),
        ]
        facts = [f"{self.modes} modes of {self.unknowns:,} unknowns"]
        return card("; ".join(self.faults) or "Audit: no fault", facts, named_values(rows))

    def as_dict(self) -> dict[str, Any]:
        """Plain dictionary, ready for JSON."""
        return asdict(self)


def audit_files(
    paths: Iterable[str | Path], tolerance: float = EIGENVALUE_TOLERANCE
) -> dict[str, Audit]:
    """Audits of modes files, see `carillon.files.paths.by_stem` for their names.

    The eigenvalues were computed to the `tolerance`. Raises UserError if a file is unusable, or its
    audit leaves the range of numbers.
    """
    return {label: _audited(path, tolerance) for label, path in by_stem(paths).items()}


def _audited(path: str, tolerance: float) -> Audit:
    try:
        return audit(read_modes(path), tolerance)
    except ArithmeticError as error:
        raise UserError(f"{path}: {error}; compute the modes again") from None


def audit(file: ModesFile, tolerance: float = EIGENVALUE_TOLERANCE) -> Audit:
    """Audit the contents of a modes file, see `measure_evidence` for parameters and errors."""
    evidence = measure_evidence(file, tolerance)
    return Audit(**vars(evidence), faults=faults(file, evidence, tolerance))


def faults(file: ModesFile, evidence: ModesEvidence, tolerance: float) -> list[str]:
    """A sentence for each fault of a modes file, whose eigenvalues were asked for to a `tolerance`.

    Solids that hang on hinges have more rigid motions than they should, which is no fault of the
    modes.
    """
    sentences = []
    if evidence.counted is not None and evidence.counted != evidence.expected:
        missing = evidence.counted - evidence.expected
        things = "1 eigenvalue is" if abs(missing) == 1 else f"{abs(missing):,} eigenvalues are"
        sentences.append(f"{things} {'missing' if missing > 0 else 'too many'}")
    rigid = file.model.rigid_modes
    if evidence.rigid_modes < rigid:
        sentences.append(f"{evidence.rigid_modes} of {rigid} rigid motions are there")
    limit = orthogonality_limit(evidence.unknowns)
    if evidence.orthogonality > limit:
        sentences.append(
            f"modes are orthonormal to {evidence.orthogonality:.1e}, {limit:.1e} is required"
        )
    values, residuals = file.eigenvalues, np.array(evidence.energy_residuals)
    errors = accepted_errors(values, np.array(evidence.rounding), ACCEPTED * tolerance, rigid)
    allowed = residual_limits(values, errors, rigid)
    over = np.flatnonzero(residuals[rigid:] > allowed[rigid:]) + rigid
    if len(over):
        worst = over[np.argmax(residuals[over] / allowed[over])]
        modes = "1 mode has" if len(over) == 1 else f"{len(over):,} modes have"
        sentences.append(
            f"{modes} too large a residual, mode {worst + 1} {residuals[worst]:.1e} in energy, "
            f"where a tolerance of {tolerance:g} allows {allowed[worst]:.1e}"
        )
    off = np.array(evidence.quotient_errors)
    far = np.flatnonzero(off * values > errors)
    if len(far):
        sentences.append(
            f"the eigenvalue of mode {far[0] + 1} is {off[far[0]]:.1e} off its shape's Rayleigh "
            "quotient"
        )
    right = frequencies(values)
    differ = np.flatnonzero(np.abs(file.frequencies - right) > ROUNDING * right.max())
    if len(differ):
        sentences.append(f"the frequency of mode {differ[0] + 1} is not that of its eigenvalue")
    return sentences
