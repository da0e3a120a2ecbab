"""What is wrong with a modes file, in sentences, by limits that follow from a tolerance.

The limits are derived in docs/explanation/trust.md.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from carillon.fem.model import RIGID_MODES
from solver.files.modes_file import ModesFile, frequencies
from solver.verification.allowance import (
    ACCEPTED,
    accepted_errors,
    orthogonality_limit,
    residual_limits,
)

if TYPE_CHECKING:  # It imports this module.
    from solver.verification.audit import Audit

ROUNDING = 1e-9
"""Relative difference of a frequency from that of its eigenvalue that rounding may make."""


def faults(file: ModesFile, audit: Audit, tolerance: float) -> list[str]:
    """A sentence for each fault of a modes file, whose eigenvalues were asked for to a `tolerance`.

    Solids that hang on hinges have more than six rigid motions, which is no fault of the modes.
    """
    found = []
    if audit.counted is not None and audit.counted != audit.expected:
        number = abs(audit.counted - audit.expected)
        things = "1 eigenvalue is" if number == 1 else f"{number:,} eigenvalues are"
        found.append(f"{things} {'missing' if audit.counted > audit.expected else 'too many'}")
    if audit.rigid_modes < RIGID_MODES:
        found.append(f"{audit.rigid_modes} of {RIGID_MODES} rigid motions are there")
    limit = orthogonality_limit(audit.unknowns)
    if audit.orthogonality > limit:
        found.append(f"modes are orthonormal to {audit.orthogonality:.1e}, {limit:.1e} is required")
    values, residuals = file.eigenvalues, np.array(audit.energy_residuals)
    errors = accepted_errors(values, np.array(audit.rounding), ACCEPTED * tolerance)
    allowed = residual_limits(values, errors)
    over = np.flatnonzero(residuals[RIGID_MODES:] > allowed[RIGID_MODES:]) + RIGID_MODES
    if len(over):
        worst = over[np.argmax(residuals[over] / allowed[over])]
        modes = "1 mode has" if len(over) == 1 else f"{len(over):,} modes have"
        found.append(
            f"{modes} too large a residual, mode {worst + 1} {residuals[worst]:.1e} in energy, "
            f"where a tolerance of {tolerance:g} allows {allowed[worst]:.1e}"
        )
    off = np.array(audit.quotient_errors)
    far = np.flatnonzero(off * values > errors)
    if len(far):
        found.append(
            f"the eigenvalue of mode {far[0] + 1} is {off[far[0]]:.1e} off its shape's Rayleigh "
            "quotient"
        )
    right = frequencies(values)
    differ = np.flatnonzero(np.abs(file.frequencies - right) > ROUNDING * right.max())
    if len(differ):
        found.append(f"the frequency of mode {differ[0] + 1} is not that of its eigenvalue")
    return found
