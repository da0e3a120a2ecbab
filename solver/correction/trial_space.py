"""Modes, directions and preconditioned residuals of a conjugate gradient iteration, side by side.

The vectors alone are kept.  Their products with K and M are made when they are needed, some columns
at a time: that takes fewer operations than carrying them along, and a third of the memory.
"""

from collections.abc import Callable

import numpy as np

from carillon.arrays import Array, Flags, Index
from carillon.errors import ConvergenceError
from carillon.processes.threads import in_parallel, split
from solver.assembly.system import System
from solver.distribution.collective import bcast_from_root
from solver.subspace.orthonormal import orthonormal
from solver.subspace.rayleigh_ritz import ORTHONORMAL, reduced_eigenpairs, ritz_weights

ROWS_AT_ONCE = 2048
"""Number of rows of the basis that are multiplied together and written back."""
COLUMNS_AT_ONCE = 16
"""Number of columns whose products with K and M exist at a time."""


class TrialSpace:
    """Span of the modes X, the directions P and the preconditioned residuals W, in one block.

    X are the Ritz vectors of a start (local, m); of a start with rigid or dependent columns there
    are fewer than m.
    """

    def __init__(self, system: System, start: Array) -> None:
        self._system = system
        count = start.shape[1]
        self._block = np.empty((len(start), 3 * count))
        self._block[:, :count] = start
        self._width = self._used = count
        self.values = self._ritz_values()
        """Ritz values (m,) of X [rad^2/s^2]."""
        # X and P projected on K, and their Gram matrix.
        self._stiff, self._gram = np.diag(self.values), np.eye(self._width)

    def _ritz_values(self) -> Array:
        """Make X mass-orthonormal Ritz vectors that are free of rigid motions, in place."""
        vectors = self._block[:, : self._width]
        values, weights = ritz_weights(self._system, vectors)

        def rotated(here: slice) -> None:
            vectors[here, : len(values)] = vectors[here] @ weights

        self._by_rows(rotated)
        self._width = self._used = len(values)
        return values

    def vectors(self) -> Array:
        """X (local, m), for which the space is given up: its block shrinks to these columns.

        What rounding has left of many steps in their Gram matrix is taken out first; fewer columns
        may be left where some became dependent.
        """
        block = self._block
        own = block[:, : self._width]
        deviation = np.abs(self._system.project_mass(own, own) - np.eye(self._width)).max()
        if deviation > ORTHONORMAL:
            self.values = self._ritz_values()
        width = self._width
        rows = len(block)
        flat = block.reshape(-1)
        for first in range(0, rows, ROWS_AT_ONCE):
            few = block[first : first + ROWS_AT_ONCE, :width].copy()
            flat[first * width : first * width + few.size] = few.reshape(-1)
        del flat, self._block
        block.resize((rows * width,), refcheck=False)
        return block.reshape(rows, width)

    def add_residuals(self, numbers: Index, precondition: Callable[[Array], Array]) -> Array:
        """Make W = `precondition`(R) of the residuals R = K X - M X Theta of some vectors (k,).

        Returns the products (k,) of each residual with its column of W.
        """
        system, block = self._system, self._block
        energy = np.empty(len(numbers))
        for first in range(0, len(numbers), COLUMNS_AT_ONCE):
            few = numbers[first : first + COLUMNS_AT_ONCE]
            vectors = _columns(block, few)
            residual = system.times_mass(vectors)
            residual *= -self.values[few]
            residual += system.times_stiffness(vectors)
            del vectors
            found = precondition(residual)
            energy[first : first + len(few)] = system.column_products(residual, found)
            place = self._used + first
            block[:, place : place + len(few)] = found
        return energy

    def step(self, moving: Flags, numbers: Index) -> None:
        """Replace X by the lowest Ritz vectors of the span of X, P and some columns of W.

        Raises ConvergenceError if the span has fewer than m independent vectors.

        Parameters
        ----------
        moving
            Which columns of W (k,) are used.
        numbers
            The vectors (w,) that they belong to, whose directions become P.
        """
        system, width = self._system, self._width
        gram, stiff = self._with_residuals(moving)
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

    def _with_residuals(self, moving: Flags) -> tuple[Array, Array]:
        """Make the `moving` columns of W orthonormal, beside rigid motions and X, in place.

        Returns the Gram matrix and the projected stiffness of X, P and W.
        """
        system, used, block = self._system, self._used, self._block
        count = np.count_nonzero(moving)
        vectors, added = block[:, : self._width], block[:, used : used + count]
        if count < len(moving):
            columns = used + np.flatnonzero(moving)

            def drawn_together(here: slice) -> None:
                added[here] = block[here, columns]

            self._by_rows(drawn_together)
        shares = system.inner(system.mass_rigid, added), system.project_mass(vectors, added)

        def swept(here: slice) -> None:
            added[here] -= system.rigid[here] @ shares[0]
            added[here] -= vectors[here] @ shares[1]

        self._by_rows(swept)
        gram = system.project_mass(added, added)
        weights, _ = bcast_from_root(system.comm, lambda: orthonormal(gram))
        basis = block[:, : used + weights.shape[1]]

        def combined(here: slice) -> None:
            basis[here, used:] = added[here] @ weights

        self._by_rows(combined)
        return (
            _bordered(self._gram, system.project_mass(basis, basis[:, used:])),
            _bordered(self._stiff, system.project_stiffness(basis, basis[:, used:])),
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


def _columns(block: Array, numbers: Index) -> Array:
    """Columns of a block, which are copied unless they follow each other."""
    if numbers[-1] - numbers[0] == len(numbers) - 1:
        return block[:, numbers[0] : numbers[-1] + 1]
    return block[:, numbers]


def _bordered(known: Array, columns: Array) -> Array:
    """Symmetric matrix of which a principal part and the last columns are given."""
    size = len(columns)
    result = np.empty((size, size))
    result[: len(known), : len(known)] = known
    result[:, len(known) :] = columns
    result[len(known) :] = result[:, len(known) :].T
    return result
