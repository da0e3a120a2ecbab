"""Damping of the engine's contacts by the coefficient of restitution."""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.optimize import brentq

PHASES = 16
"""Number of moments within a step at which a bounce may begin; their bounces are averaged."""
MOST_DAMPED = 1.5
"""Greatest damping ratio that the engine's steps resolve."""


@cache
def damping_ratio(restitution: float, steps: int) -> float:
    """Damping ratio of a spring and damper that push but never pull.

    Parameters
    ----------
    restitution : float
        Speed after a bounce over the speed before it.
    steps : int
        Number of the engine's steps in half a period of the spring.

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
    ratio = brentq(lambda each: restitution_of(each, steps) - restitution, 0.0, MOST_DAMPED)
    return float(ratio)


def restitution_of(ratio: float, steps: int) -> float:
    """Speed after a bounce over the speed before it, by the engine's own steps."""
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
