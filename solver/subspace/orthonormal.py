"""Orthonormal combinations of vectors, from their Gram matrix."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
from numpy.typing import NDArray

Array = NDArray[np.float64]

DEPENDENT = 1e-11
"""Squared share of the vectors below which a direction is dropped."""
WELL_CONDITIONED = 1e-3
"""Least diagonal entry of the scaled Gram matrix's Cholesky factor for which the factor is used."""
CANCELLED = 1e4
"""Ratio of the part taken from a vector to the rest from which it is taken twice."""


def orthonormal(gram: Array) -> tuple[Array, float]:
    """Coefficients T that make vectors with this Gram matrix orthonormal, dependent ones dropped.

    Also returns the least diagonal entry of the Cholesky factor of the scaled matrix, 0 if there is
    none.
    """
    if not gram.size:  # of which LAPACK complains on standard output, where results are printed
        return gram, 1.0
    size = np.diag(gram)
    usable = size > 0.0
    scale = np.where(usable, 1.0 / np.sqrt(np.where(usable, size, 1.0)), 0.0)
    gram = gram * scale * scale[:, None]
    factor, failed = la.lapack.dpotrf(gram, lower=True, clean=True)
    condition = 0.0 if failed else float(np.diag(factor).min(initial=1.0))
    if condition > WELL_CONDITIONED:
        inverse, _ = la.lapack.dtrtri(factor, lower=True)
        return scale[:, None] * inverse.T, condition
    spread, directions = la.eigh(gram, driver="evd", check_finite=False)
    independent = spread > DEPENDENT * max(spread[-1], 0.0)
    whitening = directions[:, independent] / np.sqrt(spread[independent])
    return scale[:, None] * whitening, condition


def largest_share(removed: Array, gram: Array) -> float:
    """How many times as long as what is left of a vector is that which was taken from it, at most.

    So many times larger become errors of the basis that it was taken in.

    Parameters
    ----------
    removed
        Coefficients (m, b) of what was taken, in an orthonormal basis.
    gram
        Gram matrix (b, b) of what is left.
    """
    taken = np.einsum("ij,ij->j", removed, removed)
    left = np.maximum(np.diag(gram), np.finfo(float).tiny)
    return float(np.sqrt((taken / left).max(initial=0.0)))


def is_cancelled(gram: Array, removed: Array) -> bool:
    """Whether so much was taken from vectors that what is left has to be made orthogonal again.

    Parameters
    ----------
    gram, removed
        See `largest_share`.
    """
    return largest_share(removed, gram) > CANCELLED
