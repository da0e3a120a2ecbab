"""How much a contact of the engine is damped so that a bounce leaves a share of the speed."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

Array = NDArray[np.float64]

PHASES = 16
"""Places within a step at which a body may arrive, over which bounces are averaged."""
MOST_DAMPED = 1.5
"""Damping ratio beyond which steps are too long to follow it."""


@cache
def damping_ratio(restitution: float, steps: int) -> float:
    """Damping ratio of a spring and damper that only push.

    Parameters
    ----------
    restitution : float
        Share of the speed that a bounce leaves.
    steps : int
        Of the engine in half a period of the spring.

    Examples
    --------
    >>> ratio = damping_ratio(0.5, 16)
    >>> bool(abs(restitution_of(ratio, 16) - 0.5) < 1e-9)
    True
    """
    if restitution >= restitution_of(0.0, steps):
        return 0.0
    if restitution <= restitution_of(MOST_DAMPED, steps):
        return MOST_DAMPED
    found = brentq(lambda ratio: restitution_of(ratio, steps) - restitution, 0.0, MOST_DAMPED)
    return float(found)


def restitution_of(ratio: float, steps: int) -> float:
    """Share of the speed that a bounce leaves, as the engine steps through it."""
    omega = np.pi / steps
    away = -(np.arange(PHASES) + 0.5) / PHASES
    speed = np.full(PHASES, -1.0)
    touching = np.ones(PHASES, dtype=bool)
    while touching.any():
        push = np.maximum(-(omega**2) * away - 2.0 * ratio * omega * speed, 0.0)
        touching &= (away < 0.0) & ((speed < 0.0) | (push > 0.0))
        speed = np.where(touching, speed + push, speed)
        away = np.where(touching, away + speed, away)
    return float(speed.mean())
