"""Audits of modes files: the evidence that a file holds, and what is wrong with it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from carillon.errors import UserError
from carillon.files.paths import by_stem
from solver.correction.criteria import EIGENVALUE_TOLERANCE
from solver.files.modes_file import ModesFile, read_modes
from solver.verification.evidence import ModesEvidence, measure_evidence
from solver.verification.faults import faults


@dataclass(frozen=True)
class Audit(ModesEvidence):
    """Evidence, and the faults that follow from it.

    Attributes
    ----------
    faults
        What is wrong, a sentence each, see `solver.verification.faults`.
    """

    faults: list[str]

    def as_dict(self) -> dict[str, Any]:
        """Plain dictionary, ready for JSON."""
        return asdict(self)


def audit_files(
    paths: Iterable[str | Path], tolerance: float = EIGENVALUE_TOLERANCE
) -> dict[str, Audit]:
    """Audits of modes files, see `carillon.files.paths.by_stem` for their names.

    The eigenvalues were computed to the `tolerance`.

    Raises
    ------
    UserError
        If a file is unusable, or its audit leaves the range of numbers.
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
