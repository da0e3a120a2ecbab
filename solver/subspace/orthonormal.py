"""Orthonormal combinations of vectors, from their Gram matrix."""

from collections.abc import Callable

import numpy as np
import scipy.linalg as la

from carillon.arrays import Array

DEPENDENT = 1e-11
"""Squared share of the vectors below which a direction is dropped."""
WELL_CONDITIONED = 1e-3
"""Least diagonal entry of the scaled Gram matrix's Cholesky factor for which the factor is used."""
INDEPENDENT = 1e-10
"""Squared share of the vectors below which `whitening` drops a direction."""
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


def swept(
    block: Array, sweep: Callable[[Array], Array], times_mass: Callable[[Array], Array], passes: int
) -> tuple[Array, Array]:
    """M times `block` (n, b), made orthogonal to a basis in place, and its Gram matrix (b, b).

    A `sweep` takes from the block what is in the basis, and returns its coefficients (m, b).  It is
    repeated, up to `passes`, while so much was taken that rounding has left some of it.
    """
    for _ in range(passes):
        removed = sweep(block)
        mass_block = times_mass(block)
        gram = block.T @ mass_block
        if largest_share(removed, gram) <= CANCELLED:
            break
    return mass_block, gram


def whitening(gram: Array) -> tuple[Array, Array]:
    """Coefficients that make vectors with this Gram matrix orthonormal, dependent ones dropped.

    Also returns the squared shares of the directions that were kept, ascending.
    """
    scale = 1.0 / np.sqrt(np.maximum(np.diag(gram), np.finfo(float).tiny))
    # numpy's eigh lets other threads run, scipy's does not.
    spread, directions = np.linalg.eigh(gram * scale * scale[:, None])
    independent = spread > INDEPENDENT * spread[-1]
    kept = spread[independent]
    return scale[:, None] * directions[:, independent] / np.sqrt(kept), kept
