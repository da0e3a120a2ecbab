"""Limits of the criteria: what the tolerance that the run asked for allows, unless others are set.

The derivations are in docs/explanation/trust.md.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solver.response.allowed_motion import motion_limit
from solver.response.response import Damping
from solver.verification.allowance import (
    ACCEPTED,
    accepted_errors,
    angle_limits,
    orthogonality_limit,
    residual_limits,
)
from workflow.validation.evidence import SOLVED, Evidence
from workflow.variants import TRUTH

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Worst:
    """The worst value of a criterion beside its limit."""

    value: float | None
    limit: float
    """Worst, and required; None if nothing was found."""
    allowed: float | None = None
    """What the tolerance of the run allows; None if nothing follows from it."""
    where: str = ""
    """The modes that have it."""


def residual(evidence: Evidence, variant: str) -> Worst:
    """Worst residual in energy of the elastic modes."""
    values, rigid = evidence.shown[variant].eigenvalues, _rigid(evidence)
    allowed = residual_limits(values, _errors(evidence, variant), rigid)[rigid:]
    values = np.array(evidence.audit["spectra"][variant]["energy_residuals"])[rigid:]
    key = "truth_residual" if variant == TRUTH else "residual"
    return _worst(values, allowed, evidence.tolerances[key], _mode(rigid))


def orthogonality(evidence: Evidence, variant: str) -> Worst:
    """Largest entry of |X^T M X - I|, as the solver itself demands it."""
    audit = evidence.audit["spectra"][variant]
    allowed = orthogonality_limit(audit["unknowns"])
    limit = evidence.tolerances["orthogonality"]
    return Worst(audit["orthogonality"], allowed if limit is None else limit, allowed)


def eigenvalue_error(evidence: Evidence) -> Worst:
    """Worst relative error of an eigenvalue of the solver."""
    exact, values = (evidence.shown[name].eigenvalues for name in (TRUTH, SOLVED))
    elastic = slice(_rigid(evidence), min(len(exact), len(values)))
    errors = np.abs(values[elastic] / exact[elastic] - 1.0)
    rounding = np.array(evidence.audit["spectra"][TRUTH]["rounding"])
    tolerance = ACCEPTED * evidence.config["solver"]["tolerance"]
    allowed = (
        accepted_errors(exact, rounding, tolerance, _rigid(evidence))[elastic] / exact[elastic]
    )
    return _worst(errors, allowed, evidence.tolerances["eigenvalue_error"], _mode(_rigid(evidence)))


def subspace_angle(evidence: Evidence) -> Worst:
    """Worst angle between a cluster of the truth and the same modes of the solver."""
    clusters = evidence.compared[SOLVED]["clusters"]
    limit = evidence.tolerances["subspace_angle"]
    if not clusters:
        return Worst(None, 0.0 if limit is None else limit)
    groups = [(cluster["first"], cluster["last"]) for cluster in clusters]
    angles = np.array([cluster["angle"] for cluster in clusters])
    names = [f"mode {a}" if a == b else f"modes {a}–{b}" for a, b in groups]
    return _worst(angles, angles_allowed(evidence, groups), limit, names.__getitem__)


def angles_allowed(evidence: Evidence, groups: list[tuple[int, int]]) -> Array:
    """Angles (g,) [rad] of clusters that the tolerance of the run allows."""
    errors = _errors(evidence, SOLVED)
    return angle_limits(evidence.shown[TRUTH].eigenvalues, errors, groups, _rigid(evidence))


def response(evidence: Evidence) -> Worst:
    """Difference of the motion after a strike by the solver's modes from that by the truth's."""
    struck, truth = evidence.response, evidence.shown[TRUTH]
    damping = Damping(struck.attributes["mass_damping"], struck.attributes["stiffness_damping"])
    rigid = _rigid(evidence)
    last = rigid + len(struck.seen.eigenvalues)
    errors = _errors(evidence, SOLVED)[rigid:last]
    unknowns = truth.model.n_dofs
    allowed = motion_limit(struck.seen, errors, damping, struck.seconds, unknowns)
    limit = evidence.tolerances["response"]
    difference = struck.responses[SOLVED].difference
    return Worst(difference, allowed if limit is None else limit, allowed)


def _errors(evidence: Evidence, variant: str) -> Array:
    """Errors that the eigenvalues of a variant may have for all that its other criteria ask.

    Those of the solver's that err more than its tolerance may do so up to what is accepted.
    """
    values = evidence.shown[variant].eigenvalues
    rounding = np.array(evidence.audit["spectra"][variant]["rounding"])
    tolerance = evidence.config["solver"]["tolerance"]
    errors = accepted_errors(values, rounding, tolerance, _rigid(evidence))
    if variant == SOLVED:
        exact = evidence.shown[TRUTH].eigenvalues
        elastic = slice(_rigid(evidence), min(len(exact), len(values)))
        found = np.abs(values[elastic] - exact[elastic])
        errors[elastic] = np.clip(found, errors[elastic], ACCEPTED * errors[elastic])
    return errors


def _rigid(evidence: Evidence) -> int:
    return evidence.shown[TRUTH].model.rigid_modes


def _mode(rigid: int) -> Callable[[int], str]:
    return lambda index: f"mode {rigid + 1 + index}"


def _worst(values: Array, allowed: Array, limit: float | None, name: Callable[[int], str]) -> Worst:
    """The largest share of a limit."""
    limits = allowed if limit is None else np.full(len(values), limit)
    share = np.where(np.isnan(values), np.inf, values / limits)
    worst = int(np.argmax(share))
    value, limit, accepted = (float(part[worst]) for part in (values, limits, allowed))
    return Worst(value, limit, accepted, name(worst))
