"""A shift amid the wanted eigenvalues, without knowing any: those below are counted by inertia."""

from __future__ import annotations

from carillon.fem.model import RIGID_MODES
from solver.assembly.system import System
from solver.linear import Inverse, LinearSolver
from solver.subspace.weyl import CountingLaw

AIM, LEAST, MOST = 0.56, 0.3, 0.72
"""Share of the wanted eigenvalues that is to lie below the shift, and what is as good as that: a
further factorisation would cost more than it saves."""
TRIES = 4
"""Factorisations at most; after them the shift is good enough."""


def inverse_amid(
    system: System,
    linear: LinearSolver,
    requested: int,
    law: CountingLaw,
    share: float = AIM,
    first: float | None = None,
) -> Inverse:
    """Inverse of K - mu M, a share of the `requested` lowest elastic eigenvalues below mu.

    Parameters
    ----------
    law
        Where eigenvalues are expected; a factor of its own is found as counts come in.
    first
        Shift to begin with, if more is known than the law.
    """
    low, high, scale = 0.0, float("inf"), 1.0
    for _ in range(TRIES - 1):
        shift = first or scale * law.eigenvalue(share * requested + RIGID_MODES)
        first = None
        if not low < shift < high:
            shift = (low * high) ** 0.5
        inverse = linear.inverse(system, shift)
        if is_amid(inverse, requested):
            return inverse
        below = inverse.negative - RIGID_MODES
        inverse.destroy()
        low, high = (max(low, shift), high) if below < AIM * requested else (low, shift)
        scale = shift / law.eigenvalue(below + RIGID_MODES)
    return linear.inverse(system, scale * law.eigenvalue(share * requested + RIGID_MODES))


def is_amid(inverse: Inverse, requested: int) -> bool:
    """Whether the shift lies amid the `requested` lowest elastic eigenvalues."""
    return LEAST * requested <= inverse.negative - RIGID_MODES <= MOST * requested
