"""Error correction by accelerated subspace iteration (section 7.2.1, Eq. 16-21)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carillon.errors import ConvergenceError
from solver.rayleigh_ritz import rayleigh_ritz, safe_shift
from solver.system import ShiftedInverse, System

Array = NDArray[np.float64]

EIGENVALUE_TOLERANCE = 1e-7
"""Relative eigenvalue error that a correction stops at unless told otherwise."""
MAX_AMPLIFICATION = 1e5
"""Largest growth of the lowest active mode over the highest in one polynomial; more would let the
low modes drown the others in rounding."""


@dataclass
class Correction:
    """Corrected eigenpairs of the elastic modes.

    Attributes
    ----------
    values
        (k,) Ritz values [rad^2/s^2].
    vectors
        (local, k) mass-orthonormal, orthogonal to the rigid motions.
    errors
        (k,) estimated relative error of each value, from its residual; NaN without an iteration.
    steps
        Number of corrections made.
    solves
        Number of right-hand sides solved.
    history
        Largest estimated error before each step.
    """

    values: Array
    vectors: Array
    errors: Array
    steps: int
    solves: int
    history: list[float]


def correct(
    system: System,
    start: Array,
    wanted: int,
    tolerance: float = EIGENVALUE_TOLERANCE,
    max_steps: int = 30,
    degree: int = 3,
    guard: int | None = None,
    report: Callable[[int, float], None] | None = None,
    observe: Callable[[int, Array], None] | None = None,
) -> Correction:
    """Improve the `wanted` lowest elastic modes from the block `start` until they are accurate.

    One step applies a polynomial of degree `degree` in (K + sigma M)^-1 M to every mode that is not
    yet accurate, and takes Ritz vectors.  Degree 1 is the over-relaxed iteration of Eq. (16)-(21)
    with the weights of Bathe & Ramaswamy (1980); higher degrees are the Chebyshev polynomials that
    damp everything beyond the iterated subspace.

    Parameters
    ----------
    start
        (local, q) approximate modes, q > wanted for a margin; rigid motions are removed.
    wanted
        Number of elastic modes to correct.
    tolerance
        Largest accepted relative eigenvalue error, as estimated from the residual.
    max_steps
        Steps allowed; reaching `tolerance` within them is not required when `tolerance` is zero.
    guard
        Extra vectors iterated beyond `wanted`; `default_guard` if not given.
    report
        Called with the step and the largest estimated error of the wanted modes.
    observe
        Called with the step and the Ritz values of the wanted modes.

    Raises
    ------
    ConvergenceError
        If `tolerance` is positive and not reached.

    Notes
    -----
    For a Ritz pair (theta, x) with residual r = K x - theta M x, the relative error of theta is
    estimated as `r^T (K + sigma M)^-1 r / (theta + sigma)`, which equals
    `(theta + sigma) x^T M (K + sigma M)^-1 M x - 1`, times `theta_p / (theta_p - theta)` since what
    x lacks lies beyond the last iterated value theta_p.  The solve is the one that the step makes
    anyway.
    """
    guard = default_guard(wanted) if guard is None else guard
    values, vectors = rayleigh_ritz(system, start, wanted + guard)
    if len(values) < wanted:
        raise ConvergenceError(
            f"the start block spans {len(values)} elastic modes, {wanted} are wanted; keep more"
        )
    if observe is not None:
        observe(0, values[:wanted])
    if len(values) == system.n_dofs - system.rigid.shape[1]:
        # The subspace is the whole space, where Ritz pairs are eigenpairs.
        exact = np.full(wanted, np.finfo(float).eps)
        return Correction(values[:wanted], vectors[:, :wanted], exact, 0, 0, [])
    inverse = ShiftedInverse(system, safe_shift(system))
    errors = np.full(len(values), np.nan)
    history: list[float] = []
    solves = 0
    step = 0
    active = 0
    try:
        while True:
            block = np.asfortranarray(vectors[:, active:])
            mass_block = system.multiply(system.M, block)
            image = inverse.solve(mass_block)
            solves += block.shape[1]
            errors[active:] = _estimate(
                values[active:],
                system.column_products(mass_block, image),
                inverse.shift,
                values[-1],
            )
            # All ranks decide by the same bits when to stop and what to lock.
            errors = system.comm.bcast(errors)
            worst = float(np.max(errors[:wanted]))
            history.append(worst)
            if report is not None:
                report(step, worst)
            if step >= max_steps and worst > tolerance:
                break
            first = _first_inaccurate(errors, wanted, tolerance)
            # Accurate modes are locked as their images, which have lost what was left of the
            # highest frequencies: the residual falls by orders of magnitude at no further solve.
            new = first - active
            locked = np.concatenate([vectors[:, :active], image[:, :new]], axis=1)
            if worst <= tolerance:
                values, vectors = rayleigh_ritz(system, locked, wanted)
                break
            filtered, used = _chebyshev(
                system, inverse, block[:, new:], image[:, new:], values[first:], degree
            )
            solves += filtered.shape[1] * (used - 1)
            values, vectors = rayleigh_ritz(
                system, np.concatenate([locked, filtered], axis=1), wanted + guard
            )
            if len(values) < wanted:
                raise ConvergenceError(
                    f"the iterated vectors collapsed to {len(values)} independent ones after "
                    f"{step + 1} steps, {wanted} modes are wanted; lower the degree or keep more"
                )
            active = min(first, len(values) - 1)
            errors = np.concatenate([errors[:active], np.full(len(values) - active, np.nan)])
            step += 1
            if observe is not None:
                observe(step, values[:wanted])
    finally:
        inverse.destroy()
    if tolerance > 0.0 and worst > tolerance:
        raise ConvergenceError(
            f"error correction reached an eigenvalue error of {worst:.1e} after {step} steps, "
            f"{tolerance:.1e} was asked for; allow more steps or keep more modes"
        )
    return Correction(
        values[:wanted],
        np.asfortranarray(vectors[:, :wanted]),
        errors[:wanted],
        step,
        solves,
        history,
    )


def default_guard(wanted: int) -> int:
    """Extra vectors that the iteration carries; the more, the faster the last modes converge."""
    return wanted // 3 + 16


def _first_inaccurate(errors: Array, wanted: int, tolerance: float) -> int:
    """Number of leading modes that need no further correction; `wanted` if none does."""
    accurate = errors[:wanted] <= tolerance
    return wanted if accurate.all() else int(np.argmin(accurate))


def _estimate(values: Array, inverse_quotient: Array, shift: float, last: float) -> Array:
    residual = (values + shift) * inverse_quotient - 1.0
    rounding = np.finfo(float).eps
    distance = np.maximum(last - values, rounding * last)
    return np.maximum(residual, rounding) * (last + shift) / distance


def _chebyshev(
    system: System,
    inverse: ShiftedInverse,
    block: Array,
    image: Array,
    values: Array,
    degree: int,
) -> tuple[Array, int]:
    """Apply the Chebyshev polynomial that damps inverse eigenvalues below the last iterated one.

    `image` is the inverse applied to `block`.  Columns are scaled by the polynomial at their own
    Ritz value, so that all keep about unit length.  Returns the columns and the degree used, which
    is lower while the lowest active mode would grow by more than `MAX_AMPLIFICATION`.
    """
    edge = 1.0 / (values[-1] + inverse.shift)
    argument = 2.0 / (edge * (values + inverse.shift)) - 1.0
    image = np.asfortranarray(image)
    before, current = block, (2.0 / edge) * image - block
    size_before, size = np.ones_like(argument), argument
    used = 1
    while used < degree and 2.0 * argument[0] * size[0] <= MAX_AMPLIFICATION * size[-1]:
        used += 1
        image = inverse.solve(system.multiply(system.M, current))
        following = 2.0 * ((2.0 / edge) * image - current) - before
        before, current = current, following
        size_before, size = size, 2.0 * argument * size - size_before
    return np.asfortranarray(current / size), used
