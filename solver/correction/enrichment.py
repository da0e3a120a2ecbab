"""One step of the error correction: a better subspace from corrections of the Ritz vectors."""

from collections.abc import Callable
from functools import partial

import numpy as np
import scipy.linalg as la

from carillon.arrays import Array, Index
from carillon.errors import ConvergenceError
from solver.assembly.system import System
from solver.distribution.collective import bcast_from_root
from solver.linear import Inverse
from solver.subspace.orthonormal import WELL_CONDITIONED, orthonormal
from solver.subspace.rayleigh_ritz import rayleigh_ritz

SMALL_CORRECTION = 1e-6
"""Squared length of corrections of unit vectors below which rounding spoils the identities."""
NEARLY_INSIDE = 1e-2
"""Squared share of a correction outside the subspace below which that part is formed first."""
ROWS_AT_ONCE = 1024
"""Number of rows of a block that are scaled together, so that they stay in the cache."""
MOST_PASSES = 3
"""Largest number of orthogonalisations of the corrections. Two suffice but for rounding."""


class Ritz:
    """Ritz vectors of a subspace, some of them locked.

    Attributes
    ----------
    values
        (m,) Ritz values [rad^2/s^2].
    vectors
        (local, m) mass-orthonormal X, orthogonal to the rigid motions; row-major.
    errors
        (m,) last estimate of each value's relative error.
    active
        Numbers of the vectors that are not locked, ascending.
    """

    def __init__(self, system: System, values: Array, vectors: Array) -> None:
        self.system = system
        self.values = values.copy()
        self.vectors = np.ascontiguousarray(vectors)
        self._mass_vectors: Array | None = None
        self.errors = np.full(len(values), np.nan)
        self.active: Index = np.arange(len(values))

    @property
    def mass_vectors(self) -> Array:
        """M X, which accurate vectors are never asked for; collective."""
        if self._mass_vectors is None:
            self._mass_vectors = self.system.times_mass(self.vectors)
        return self._mass_vectors

    @property
    def locked(self) -> int:
        """Number of locked vectors."""
        return len(self.values) - len(self.active)

    def lock(self, numbers: Index) -> None:
        """Leave these vectors as they are from now on."""
        self.active = self.active[~np.isin(self.active, numbers)]

    def unlock(self, numbers: Index) -> None:
        """Let these vectors be improved again, as far as they are locked."""
        self.active = np.union1d(self.active, numbers)

    def residual(self, numbers: Index) -> Array:
        """K X - M X Theta of some vectors, whose values become their Rayleigh quotients.

        An error of a value shows in the residual to second order only, so none may creep in.
        """
        chosen = _range(numbers)
        vectors = np.ascontiguousarray(self.vectors[:, chosen])
        residual = self.system.times_stiffness(vectors)
        quotients = self.system.column_products(vectors, residual)
        self.values[numbers] = bcast_from_root(self.system.comm, lambda: quotients)
        mass_vectors, values = self.mass_vectors[:, chosen], self.values[numbers]
        for first in range(0, len(residual), ROWS_AT_ONCE):
            rows = slice(first, first + ROWS_AT_ONCE)
            residual[rows] -= mass_vectors[rows] * values
        return residual

    def replace_active(self, values: Array, vectors: Array) -> None:
        """Put new vectors in the place of the active ones; locked ones come first."""
        locked = np.ones(len(self.values), dtype=bool)
        locked[self.active] = False
        mass_vectors = self.system.times_mass(vectors)
        if locked.any():
            vectors = np.concatenate([self.vectors[:, locked], vectors], axis=1)
            mass_vectors = np.concatenate([self.mass_vectors[:, locked], mass_vectors], axis=1)
        self.vectors, self._mass_vectors = vectors, mass_vectors
        count = int(locked.sum())
        self.values = np.concatenate([self.values[locked], values])
        self.errors = np.concatenate([self.errors[locked], np.full(len(values), np.nan)])
        self.active = np.arange(count, len(self.values))

    def lowest(self, count: int) -> tuple[Array, Array, Array]:
        """Values, vectors and errors of the lowest `count`, ascending."""
        order = np.argsort(self.values, kind="stable")[:count]
        vectors = np.ascontiguousarray(self.vectors[:, _range(order)])
        return self.values[order], vectors, self.errors[order]


def _range(numbers: Index) -> Index | slice:
    """The numbers as a slice, of which numpy makes no copy, if they follow each other."""
    if len(numbers) and (np.diff(numbers) == 1).all():
        return slice(int(numbers[0]), int(numbers[-1]) + 1)
    return numbers


Step = Callable[[Ritz, Array, Index, Inverse, int], None]
"""A step of the iteration: improves active Ritz vectors (m,) by `corrections` (local, a), which
solve for the residuals of the vectors `numbers` (a,)."""


def enrich(ritz: Ritz, corrections: Array, numbers: Index, inverse: Inverse, width: int) -> None:
    """Rayleigh-Ritz in the span of the active vectors and their corrections.

    Of the result as many vectors stay that the whole has `width`. Raises ConvergenceError if a Ritz
    value is not positive, which rounding alone can cause.

    Notes
    -----
    With exact solves K Z = R + mu M Z, and X^T R = 0 for active X, which are Ritz vectors of their
    span, so the projections of K follow from those of M: X^T K Z = mu X^T M Z, and
    R^T Z = (mu - Theta) X^T M Z.  Where some X are locked, or solutions are inexact or very small,
    Z is multiplied by K.
    """
    system = ritz.system
    Z, overlap, gram, untouched = _independent(ritz, corrections)
    if inverse.exact and untouched and np.diag(gram).min(initial=1.0) > SMALL_CORRECTION:
        mu = inverse.shift
        across = mu * overlap
        half = (mu - ritz.values[numbers]) * overlap[numbers].T
        stiff = mu * gram + 0.5 * (half + half.T)
    else:
        KZ = system.times_stiffness(Z)
        across = system.inner(ritz.vectors, KZ)
        stiff = system.inner(Z, KZ)
        del KZ
    keep = max(0, width - ritz.locked)

    # Solved once: two processors may round apart, and an eigenvector's sign hangs on rounding.
    values, of_all, of_corrections = bcast_from_root(
        system.comm, lambda: _lowest(ritz.values, ritz.active, overlap, gram, across, stiff, keep)
    )
    if len(values) and values[0] <= 0.0:
        raise ConvergenceError(
            f"error correction found an eigenvalue of {values[0]:.3g} rad^2/s^2 for a stiffness "
            "that has none below zero: rounding spoils it; ask for a looser tolerance"
        )
    vectors = ritz.vectors @ of_all
    vectors += Z @ of_corrections
    ritz.replace_active(values, vectors)


def _independent(ritz: Ritz, Z: Array) -> tuple[Array, Array, Array, bool]:
    """Z, or a basis of what it adds to X, well-conditioned enough to orthonormalise by Cholesky.

    Also returns X^T M Z, Z^T M Z, and whether Z (local, a) was good as it is.
    """
    system = ritz.system
    for passes in range(MOST_PASSES):
        Z -= system.rigid @ system.inner(system.mass_rigid, Z)
        overlap = system.inner(ritz.mass_vectors, Z)
        gram = system.inner(Z, system.times_mass(Z))
        outside = _outside(overlap, gram)
        basis, condition = bcast_from_root(system.comm, partial(orthonormal, outside))
        alone = bool((np.diag(outside) > NEARLY_INSIDE * np.diag(gram)).all())
        # Locked vectors are coupled to the active ones by K, which no formula below accounts for.
        good = alone and condition > WELL_CONDITIONED and not (ritz.locked and passes == 0)
        if good or passes == MOST_PASSES - 1:
            break
        # Small differences of large numbers: what is outside X is formed, then judged again.
        Z = Z @ basis
        Z -= ritz.vectors @ (overlap @ basis)
    return Z, overlap, gram, passes == 0


def _outside(overlap: Array, gram: Array) -> Array:
    """Gram matrix of the part of Z outside X."""
    outside = gram - overlap.T @ overlap
    return np.asarray(0.5 * (outside + outside.T))


def _lowest(
    theta: Array, active: Index, overlap: Array, gram: Array, across: Array, stiff: Array, keep: int
) -> tuple[Array, Array, Array]:
    """Lowest pairs of the pencil projected on the active X and the part of Z outside X.

    They are values (k,), and coefficients of X (m, k) and of Z (a, k).
    """
    basis, _ = orthonormal(_outside(overlap, gram))
    # Q = (Z - X C) T is orthonormal and orthogonal to X; K X is Theta M X within the subspace.
    coupling = (across[active] - theta[active, None] * overlap[active]) @ basis
    inner = stiff - overlap.T @ across - across.T @ overlap + overlap.T @ (theta[:, None] * overlap)
    size, extra = len(active), basis.shape[1]
    H = np.zeros((size + extra, size + extra), order="F")
    H[np.arange(size), np.arange(size)] = theta[active]
    H[size:, :size] = coupling.T
    H[size:, size:] = basis.T @ inner @ basis
    values, vectors = la.eigh(H, driver="evd", lower=True, overwrite_a=True, check_finite=False)
    keep = min(keep, len(values))
    of_basis = basis @ vectors[size:, :keep]
    of_all = -overlap @ of_basis
    of_all[active] += vectors[:size, :keep]
    return values[:keep], of_all, of_basis


def relax(ritz: Ritz, corrections: Array, numbers: Index, inverse: Inverse, width: int) -> None:
    """Rayleigh-Ritz in the span of X - w Z, the over-relaxed subspace iteration of the paper.

    The weight w = 1 + theta / (theta + theta_p) / 2 grows from 1 for the lowest modes, which
    converge fast, towards 1.25 for the last (a mild choice of Bathe & Ramaswamy 1980).
    """
    system, values = ritz.system, ritz.values[numbers]
    weight = 1.0 + 0.5 * np.abs(values) / (np.abs(values) + ritz.values.max())
    iterated = ritz.vectors[:, ritz.active]
    position = np.searchsorted(ritz.active, numbers)
    iterated[:, position] -= corrections * weight
    locked = np.setdiff1d(np.arange(len(ritz.values)), ritz.active)
    iterated -= ritz.vectors[:, locked] @ system.inner(ritz.mass_vectors[:, locked], iterated)
    values, vectors = rayleigh_ritz(system, iterated, max(0, width - ritz.locked))
    ritz.replace_active(values, vectors)
