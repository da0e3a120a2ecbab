"""Krylov space of (K - mu M)^-1 M by blocks, and the Ritz pairs in it.

The Krylov spaces of `solver.hcms.lowest` and of `sound.design` share `swept` and `whitening`; this
one is spread over ranks, and its projected operator is what orthogonalisation has removed, where
those project K anew.  Its blocks become orthonormal by Cholesky, theirs by eigenvectors of the Gram
matrix: one code for all would change last bits.
"""

from functools import partial

import numpy as np
import scipy.linalg as la

from carillon.arrays import Array, Index
from solver.assembly.narrow import combination
from solver.assembly.system import System
from solver.distribution.collective import bcast_from_root
from solver.linear import Inverse
from solver.subspace.basis import BlockBasis
from solver.subspace.orthonormal import largest_share, orthonormal

PESSIMISM = 3.0
"""Least ratio of the error bounds of the operator's eigenvalues to the errors of the Ritz values of
K."""
ZERO_FRACTION = 1e-8
"""Share of the last requested eigenvalue below which an eigenvalue counts as zero, and its error as
absolute."""
ROUNDING_FRACTION = 1e-3
"""Largest distance below zero of a small eigenvalue by rounding, as a share of the shift."""
ROUNDING = 1e-11
"""Error of an eigenvalue by rounding, as a share of the shift."""
MOST_PASSES = 3
"""Largest number of repeated orthogonalisations. One suffices unless rounding alone is left."""
ORTHOGONAL = 1e-11
"""Largest overlap of a block with the basis."""
INDEPENDENT = 0.03
"""Condition, see `orthonormal`, above which vectors come out orthonormal to 1e-12 in one pass."""
EPSILON = float(np.finfo(float).eps)
RESOLVED = 1e-2
"""Squared share of the residual in the image of a Ritz vector below which the vector is
resolved."""


class KrylovBasis:
    """Orthonormal basis of the Krylov space, with the projected operator.

    Its `remainder` (local, b) is the orthonormal block that comes next.
    """

    def __init__(self, system: System, inverse: Inverse, start: Array, capacity: int) -> None:
        self._system = system
        self._inverse = inverse
        width = start.shape[1]
        self._rigid = system.rigid.shape[1]
        rigid_blocks = -(-self._rigid // width)
        self._vectors = BlockBasis(system, width, rigid_blocks + capacity // width + 1)
        for first in range(0, self._rigid, width):
            self._vectors.append(system.rigid[:, first : first + width])
        self._operator = np.zeros((capacity, capacity))
        self._pairs: tuple[Array, Array, Array] | None = None
        self.size = self.blocks = 0
        # How far the basis is from orthonormal, about.
        self._lost = EPSILON
        self._last = slice(0, 0)
        start = start.copy()
        self._sweep(start)
        mass_start = system.times_mass(start)
        self._continue_with(start, mass_start, system.inner(start, mass_start))
        self._coupling = np.zeros((self.remainder.shape[1], 0))

    def extend(self) -> None:
        """Add the next block, and find the one after it."""
        system, block = self._system, self.remainder
        here = slice(self.size, self.size + block.shape[1])
        self._vectors.append(block)
        self._operator[here, self._last] = self._coupling
        self._operator[self._last, here] = self._coupling.T
        self.size = here.stop
        self.blocks += 1
        self._pairs = None

        image = self._inverse.solve(self._mass_remainder)
        overlap = self._sweep(image)
        mass_image = system.times_mass(image)
        gram = system.inner(image, mass_image)
        growth = largest_share(overlap, gram)
        lost = growth * self._lost
        for _ in range(MOST_PASSES):
            if lost <= ORTHOGONAL:
                break
            removed = self._sweep(image)
            overlap += removed
            mass_image = system.times_mass(image)
            gram = system.inner(image, mass_image)
            # What the first sweep has left tells how far the basis is from orthonormal in truth.
            again = largest_share(removed, gram)
            self._lost = max(again / growth, EPSILON)
            lost, growth = again * max(again, self._lost), again
        self._lost = max(self._lost, lost)
        diagonal = overlap[self._rigid + here.start :]
        self._operator[here, here] = 0.5 * (diagonal + diagonal.T)
        self._continue_with(image, mass_image, gram)
        self._last = here

    def go_on_with(self, block: Array) -> None:
        """Let the part of `block` (local, b) that is outside the basis come next.

        The space is invariant then: nothing couples that block to the last one.
        """
        for _ in range(2):
            self._sweep(block)
        mass_block = self._system.times_mass(block)
        self._continue_with(block, mass_block, self._system.inner(block, mass_block))
        self._coupling = np.zeros((self.remainder.shape[1], self._last.stop - self._last.start))
        self._pairs = None

    def _sweep(self, image: Array) -> Array:
        """Make `image` orthogonal to the rigid motions and the basis; returns what it held."""
        overlap = self._vectors.inner(self._system.times_mass(image))
        self._vectors.remove(overlap, image)
        return overlap

    def _continue_with(self, block: Array, mass_block: Array, gram: Array) -> None:
        """Q and M Q with Q^T M Q = I and Q R = `block`, and R, come next."""
        system = self._system
        weights, condition = bcast_from_root(system.comm, lambda: orthonormal(gram))
        self._coupling = weights.T @ gram
        combined = partial(combination, threads=system.rows.threads)
        self.remainder: Array = combined(block, weights)
        self._mass_remainder = combined(mass_block, weights)
        for _ in range(MOST_PASSES):
            if condition > INDEPENDENT:
                break
            # Small differences of large vectors: they are no longer orthogonal to the basis either.
            self._sweep(self.remainder)
            again = system.inner(self.remainder, system.times_mass(self.remainder))
            weights, condition = bcast_from_root(system.comm, partial(orthonormal, again))
            self.remainder = combined(self.remainder, weights)
            self._mass_remainder = system.times_mass(self.remainder)
            self._coupling = system.inner(self._mass_remainder, block)
        room = system.n_dofs - self._rigid - self.size
        if self.remainder.shape[1] > room:
            # In a space that is nearly exhausted the first directions are of rounding alone.
            rest = slice(self.remainder.shape[1] - room, None)
            self.remainder = np.ascontiguousarray(self.remainder[:, rest])
            self._mass_remainder = np.ascontiguousarray(self._mass_remainder[:, rest])
            self._coupling = self._coupling[rest]

    def outlook(self, requested: int) -> tuple[Array, float]:
        """Estimated relative errors (requested,) of the lowest eigenvalues, and the last of these.

        None and infinity as long as there are too few.  All errors are 1 at least while fewer
        values are below the shift than inertia counts: some are missing.
        """
        inverted, _, residual = self._operator_pairs()
        mu = self._inverse.shift
        order, values = _lowest(inverted, mu, len(inverted))
        if len(order) <= requested:
            return np.empty(0), np.inf
        inverted = inverted[order]
        square = np.einsum("ij,ij->j", residual[:, order], residual[:, order])
        unresolved = np.flatnonzero(square > RESOLVED * inverted**2)
        # What is not resolved yet lies beyond the first such value.
        first = min([*unresolved[unresolved >= requested], len(order) - 1])
        distance = np.abs(inverted - inverted[first])[:requested]
        below = np.count_nonzero(values < mu)
        values = values[:requested]
        size = np.maximum(values, ZERO_FRACTION * values[-1])
        error = square[:requested] / distance * (values - mu) ** 2 / size
        error = error / PESSIMISM + ROUNDING * abs(mu) / size
        if below < self._inverse.negative - self._rigid:
            error = np.maximum(error, 1.0)
        return error, float(values[requested - 1])

    def _operator_pairs(self) -> tuple[Array, Array, Array]:
        """Ritz values and coefficients of the operator, and those of the residuals in `remainder`.

        Solved once: two processors may round apart.
        """

        def solve() -> tuple[Array, Array, Array]:
            T = self._operator[: self.size, : self.size]
            inverted, vectors = la.eigh(T, driver="evd", check_finite=False)
            return inverted, vectors, self._coupling @ vectors[self._last]

        if self._pairs is None:
            self._pairs = bcast_from_root(self._system.comm, solve)
        return self._pairs

    def ritz_pairs(self, count: int) -> tuple[Array, Array]:
        """The lowest `count` Ritz pairs of K, in the span of the operator's and the remainder.

        With the operator's Ritz pairs (nu, Y) and residuals Q G Q spanned by the remainder,
        K - mu M is projected to diag(1/nu) + (G/nu)^T S (G/nu) on Y, -S G/nu across, and S on Q.
        """
        system, mu = self._system, self._inverse.shift
        block = self.remainder
        last = system.inner(block, system.times_stiffness(block))
        last = 0.5 * (last + last.T) - mu * np.eye(len(last))
        inverted, vectors, residual = self._operator_pairs()

        def project() -> tuple[Array, Array, Array]:
            order, _ = _lowest(inverted, mu, count)
            across = residual[:, order] / inverted[order]
            size = len(order)
            H = np.empty((size + len(last),) * 2, order="F")
            H[:size, :size] = np.diag(1.0 / inverted[order]) + across.T @ last @ across
            H[size:, :size] = -last @ across
            H[:size, size:] = H[size:, :size].T
            H[size:, size:] = last
            values, weights = la.eigh(H, driver="evd", overwrite_a=True, check_finite=False)
            weights = weights[:, :size]
            return values[:size] + mu, vectors[:, order] @ weights[:size], weights[size:]

        values, weights, of_last = bcast_from_root(system.comm, project)
        rigid = np.zeros((self._rigid, weights.shape[1]))
        return values, self._vectors.combine(np.concatenate([rigid, weights]), block, of_last)


def _lowest(inverted: Array, shift: float, count: int) -> tuple[Index, Array]:
    """Numbers and values of the `count` lowest eigenvalues shift + 1 / inverted, none negative.

    Those of motions with hardly any stiffness are zero but for rounding; what they are in truth is
    for the stiffness to say.
    """
    values = shift + 1.0 / inverted
    possible = np.flatnonzero(values > -ROUNDING_FRACTION * abs(shift))
    order = possible[np.argsort(values[possible])][:count]
    return order, values[order]
