"""How accurate corrected modes become, and how many vectors are carried for that."""

EIGENVALUE_TOLERANCE = 1e-7
"""Default of the relative eigenvalue error at which a correction stops."""
INTERACTIVE_TOLERANCE = 1e-2
"""Relative error of the worst eigenvalue that suffices while a material is designed."""
STEPWISE = ("krylov", "relaxation")
"""Accelerations that correct every mode by itself."""
ACCELERATIONS = ("lanczos", *STEPWISE)
LOOSE = 1e-3
"""Least tolerance for which the inverse of a similar material serves for the steps."""
GUARD_FRACTION, FEWEST_GUARDS = 0.22, 20
"""Guard vectors, carried beyond the requested modes: their share of these, and their least
number."""
IMPROVED_GUARDS = 0.4
"""Share of the guard vectors that are improved too, so that the last requested modes converge."""


def carried_count(requested: int, tolerance: float) -> int:
    """Vectors that a block Lanczos iteration is to return: the wanted ones and those beyond."""
    guard = default_guard(requested)
    return requested + (guard if tolerance >= LOOSE else int(IMPROVED_GUARDS * guard) + 1)


def accurate_count(requested: int, tolerance: float) -> int:
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
