"""What an error correction is asked for, and what comes of it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from solver.linear import Lasting

Array = NDArray[np.float64]

EIGENVALUE_TOLERANCE = 1e-7
"""Relative eigenvalue error that a correction stops at unless told otherwise."""
INTERACTIVE_TOLERANCE = 1e-2
"""Relative eigenvalue error of the worst mode that is good enough while a material is designed."""
STEPWISE = ("krylov", "relaxation")
"""Accelerations that correct every mode by itself, step by step."""
ACCELERATIONS = ("lanczos", *STEPWISE)
LOOSE = 1e-3
"""Tolerance from which on an inverse for a similar material is good enough for steps."""
GUARD_FRACTION, FEWEST_GUARDS = 0.22, 20
"""Vectors carried beyond the wanted ones, as a share of these, and the fewest of them."""
IMPROVED_GUARDS = 0.4
"""Share of the guard vectors that are improved too, for the sake of the last wanted modes."""


@dataclass
class Correction:
    """Corrected eigenpairs of the elastic modes.

    Attributes
    ----------
    values
        (k,) Ritz values [rad^2/s^2], ascending.
    vectors
        (local, k) mass-orthonormal, orthogonal to the rigid motions, row-major.
    errors
        (k,) estimated relative error of each value, from its residual.
    guard
        (local, g) what the iteration carried beyond; useful to start again from.
    steps
        Number of corrections made.
    solves, blocks
        Number of right-hand sides solved, and of the blocks that they came in.
    history
        Largest estimated error before each step, and at the end.
    inverse
        Inverse for this material that a similar one may start with; None if there is none to keep.
    """

    values: Array
    vectors: Array
    errors: Array
    guard: Array
    steps: int = 0
    solves: int = 0
    blocks: int = 0
    history: list[float] = field(default_factory=list)
    inverse: Lasting | None = None


def carried(requested: int, tolerance: float) -> int:
    """Vectors that a block Lanczos iteration is to return: the wanted ones and those beyond."""
    guard = default_guard(requested)
    return requested + (guard if tolerance >= LOOSE else int(IMPROVED_GUARDS * guard) + 1)


def resolved(requested: int, tolerance: float) -> int:
    """Modes that a first iteration has to find accurately.

    Those beyond decide how fast the modes of a similar material follow, which only a loose
    tolerance is for.
    """
    return requested + (
        int(IMPROVED_GUARDS * default_guard(requested)) if tolerance >= LOOSE else 0
    )


def default_guard(requested: int) -> int:
    """Extra vectors that the iteration carries; the more, the faster the last modes converge."""
    return max(FEWEST_GUARDS, int(GUARD_FRACTION * requested))
