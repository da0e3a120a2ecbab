"""By how much a spectrum may differ from the exact one if its eigenvalues meet a tolerance.

Everything here follows from an accepted error e_m of every eigenvalue, for mass-orthonormal Ritz
vectors: the larger the sum E_k = e_7 + ... + e_k, the more of the first k modes may lie outside the
span of the first k Ritz vectors, and the trace of K in that span then tells by how much.  The
derivation is in docs/explanation/trust.md.
"""

from collections.abc import Sequence

import numpy as np

from carillon.arrays import Array
from carillon.fem.model import RIGID_MODES
from solver.verification.residuals import ORTHOGONALITY_TOLERANCE

ACCEPTED = 10.0
"""Accepted relative error of an eigenvalue, as a multiple of the tolerance of the run, which stops
by an estimate of second order and not by a bound."""
OPERATIONS = 100.0
"""Roundings that add up in an entry of a product with the stiffness, at most: it has 81 to 375
entries in a row, of up to 8 cells each, and their errors do not all have one sign."""


def accepted_errors(
    values: Array, rounding: Array, tolerance: float, rigid: int = RIGID_MODES
) -> Array:
    """Accepted errors e (k,) [rad^2/s^2] of the elastic eigenvalues, 0 of the rigid ones.

    Parameters
    ----------
    values
        (k,) ascending eigenvalues [rad^2/s^2], rigid ones first.
    rounding
        (k,) relative change of each by one rounding of every product, see `ModesEvidence.rounding`.
    tolerance
        Relative error of an eigenvalue that is accepted but for rounding.
    """
    errors = values * (tolerance + OPERATIONS * rounding)
    errors[:rigid] = 0.0
    return np.asarray(errors)


def orthogonality_limit(unknowns: int) -> float:
    """Largest entry of |X^T M X - I| that a solver accepts, and rounding of a sum anew."""
    return ORTHOGONALITY_TOLERANCE + float(np.finfo(float).eps) * unknowns


def residual_limits(values: Array, errors: Array, rigid: int = RIGID_MODES) -> Array:
    """Largest `ModesEvidence.energy_residuals` (k,) that accepted `errors` allow.

    |r|_(K + s M)^-1 <= sqrt(2 E_i), here over sqrt(lambda_i).

    Examples
    --------
    >>> values = np.array([0.0] * 6 + [1.0, 4.0])
    >>> residual_limits(values, 1e-6 * values)[6:].round(5)
    array([0.00141, 0.00158])
    """
    scale = np.maximum(values, values[rigid])
    return np.asarray(np.sqrt(2.0 * np.cumsum(errors) / scale))


def angle_limits(
    values: Array, errors: Array, groups: Sequence[tuple[int, int]], rigid: int = RIGID_MODES
) -> Array:
    """Largest angles (g,) [rad] of clusters of modes a..b, numbered from 1, to the exact ones.

    sin^2 <= E_b / (lambda_(b+1) - lambda_b) + E_(a-1) / (lambda_a - lambda_(a-1)).

    Examples
    --------
    >>> values = np.array([0.0] * 6 + [1.0, 2.0, 3.0])
    >>> angle_limits(values, 1e-6 * values, [(7, 7), (8, 8)])
    array([0.001, 0.002])
    """
    total = np.cumsum(errors)
    limits = np.empty(len(groups))
    for index, (first, last) in enumerate(groups):
        square = total[last - 1] / (values[last] - values[last - 1])
        if first > rigid + 1:
            square += total[first - 2] / (values[first - 1] - values[first - 2])
        limits[index] = np.arcsin(min(1.0, np.sqrt(square)))
    return limits
