"""Modes, directions and preconditioned residuals of a conjugate gradient iteration, side by side.

The vectors alone are kept.  Their products with K and M are made when they are needed, some columns
at a time: that takes fewer operations than carrying them along, and a third of the memory.
"""

from collections.abc import Callable

import numpy as np

from carillon.arrays import Array, Index
from carillon.errors import ConvergenceError
from carillon.processes.threads import in_parallel, split
from solver.assembly.system import System
from solver.distribution.collective import bcast_from_root
from solver.subspace.orthonormal import orthonormal
from solver.subspace.rayleigh_ritz import reduced_eigenpairs

ROWS_AT_ONCE = 2048
"""Number of rows of the basis that are multiplied together and written back."""
COLUMNS_AT_ONCE = 16
"""Number of columns whose products with K and M exist at a time."""


class TrialSpace:
    """Span of the modes X, the directions P and the preconditioned residuals W.

    Parameters
    ----------
    values
        (m,) Ritz values of X [rad^2/s^2].
    vectors
        (local, m) X, mass-orthonormal and free of rigid motions.
    """

    def __init__(self, system: System, values: Array, vectors: Array) -> None:
        self._system = system
        self._width = self._used = len(values)
        self.values = values
        self._block = np.empty((len(vectors), 3 * self._width))
        self._block[:, : self._width] = vectors
        # X and P projected on K, and their Gram matrix.
        self._stiff, self._gram = np.diag(values), np.eye(self._width)

    @property
    def vectors(self) -> Array:
        """X (local, m)."""
        return np.ascontiguousarray(self._block[:, : self._width])

    def preconditioned_residuals(
        self, numbers: Index, precondition: Callable[[Array], Array]
    ) -> tuple[Array, Array]:
        """W (local, k) = `precondition`(R) for the residuals R = K X - M X Theta of some vectors.

        Also returns the products (k,) of each residual with its column of W.
        """
        image = np.empty((len(self._block), len(numbers)))
        energy = np.empty(len(numbers))
        for first in range(0, len(numbers), COLUMNS_AT_ONCE):
            few = numbers[first : first + COLUMNS_AT_ONCE]
            chosen = slice(first, first + len(few))
            vectors = np.ascontiguousarray(self._block[:, few])
            residual = self._system.times_mass(vectors)
            residual *= -self.values[few]
            residual += self._system.times_stiffness(vectors)
            del vectors
            found = precondition(residual)
            energy[chosen] = self._system.column_products(residual, found)
            image[:, chosen] = found
        return image, energy

    def step(self, image: Array, numbers: Index) -> None:
        """Replace X by the lowest Ritz vectors of the span of X, P and `image` (local, w).

        `numbers` (w,) are the vectors whose directions are kept for the next step. Raises
        ConvergenceError if the span has fewer than m independent vectors.
        """
        system, width = self._system, self._width
        gram, stiff = self._append(image)
        whole = len(gram)
        # Solved once: two processors may round apart, and an eigenvector's sign hangs on rounding.
        values, weights = bcast_from_root(system.comm, lambda: reduced_eigenpairs(stiff, gram))
        if len(values) < width or not np.isfinite(values[:width]).all():
            raise ConvergenceError(
                f"conjugate gradients lost some of their {width} vectors, which became linearly "
                "dependent; ask for fewer --modes or use --method auto"
            )
        weights = weights[:, :width]
        directions = weights[:, numbers].copy()
        directions[:width] = 0.0
        self._rotate(weights, numbers, whole)
        both = np.concatenate([weights, directions], axis=1)
        self._stiff, self._gram = both.T @ stiff @ both, both.T @ gram @ both
        self.values = values[:width]
        self._used = both.shape[1]

    def _append(self, image: Array) -> tuple[Array, Array]:
        """Put an orthonormal basis of what is in `image` beside rigid motions and X after X and P.

        Returns the Gram matrix and the projected stiffness of all three. The image is overwritten.
        """
        system, used, block = self._system, self._used, self._block
        vectors = block[:, : self._width]
        shares = system.inner(system.mass_rigid, image), system.project_mass(vectors, image)

        def swept(here: slice) -> None:
            image[here] -= system.rigid[here] @ shares[0]
            image[here] -= vectors[here] @ shares[1]

        self._by_rows(swept)
        gram = system.project_mass(image, image)
        weights, _ = bcast_from_root(system.comm, lambda: orthonormal(gram))
        whole = used + weights.shape[1]

        def combined(here: slice) -> None:
            block[here, used:whole] = image[here] @ weights

        self._by_rows(combined)
        basis, added = block[:, :whole], np.ascontiguousarray(block[:, used:whole])
        return (
            _bordered(self._gram, system.project_mass(basis, added)),
            _bordered(self._stiff, system.project_stiffness(basis, added)),
        )

    def _rotate(self, weights: Array, numbers: Index, whole: int) -> None:
        """X and P of the next step, in place, from `weights` (whole, m) of X, P and W."""
        width, block = self._width, self._block
        of_vectors, of_others = weights[:width], weights[width:]

        def rows(here: slice) -> None:
            directions = block[here, width:whole] @ of_others
            vectors = block[here, :width] @ of_vectors
            np.add(vectors, directions, out=block[here, :width])
            block[here, width : width + len(numbers)] = directions[:, numbers]

        self._by_rows(rows)

    def _by_rows(self, work: Callable[[slice], None]) -> None:
        """Call `work` with a few rows of the block at a time, which the threads share."""
        rows, threads = len(self._block), self._system.rows.threads

        def part(start: int, stop: int) -> None:
            for first in range(start, stop, ROWS_AT_ONCE):
                work(slice(first, min(first + ROWS_AT_ONCE, stop)))

        in_parallel(part, split(rows, threads, max(rows, 1)), threads)


def _bordered(known: Array, columns: Array) -> Array:
    """Symmetric matrix of which a principal part and the last columns are given."""
    size = len(columns)
    result = np.empty((size, size))
    result[: len(known), : len(known)] = known
    result[:, len(known) :] = columns
    result[len(known) :] = result[:, len(known) :].T
    return result
