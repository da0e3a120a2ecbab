"""Block Lanczos iteration around a shift inside the spectrum.

It may begin from anything.  Approximate modes are mixed into few columns, each of which holds modes
that lie far apart: a Krylov space of them holds all the modes again, and what their errors have in
common is removed from all of them by every solve.  It takes about half the right-hand sides that
correcting each mode by itself takes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
from numpy.typing import NDArray

from solver.assembly.system import System
from solver.distribution.collective import bcast_from_root
from solver.linear import Inverse
from solver.subspace.basis import BlockBasis
from solver.subspace.orthonormal import WELL_CONDITIONED, is_cancelled, orthonormal

Array = NDArray[np.float64]

COLUMNS, FEWEST_COLUMNS = 64, 16
"""Widest and narrowest block: the narrower, the fewer right-hand sides; the wider, the faster."""
MIXED_IN_COLUMN = 4
"""Wanted modes in a column of the first block; the space has to tell them apart again."""
END_WEIGHT = 2.0
"""Exponent of a mode's distance to the shift, by which it enters the first block."""
LEAST_WEIGHT = 1e-3
"""Weight that it has at least, as a share of the greatest: the shift may be one of the values."""
MIXED = 1.15
"""Modes that enter the first block, as a share of those wanted, in case some are out of order."""
ROUGH = 1e-3
"""Tolerance above which those wanted alone enter: fewer steps then tell them apart."""
FIRST_LOOK, RANDOM_LOOK = 1.25, 1.75
"""Dimension of the space at the first look at its Ritz values, as a share of the modes mixed, and
of those wanted after a random start."""
DECADES = 2.0
"""Decades that a block takes off the error at least, until two looks have told."""
HIGHEST_SHIFT = 0.8
"""Share of the last wanted eigenvalue above which a shift is too high."""
LONGEST = 4
"""Dimension at which the iteration ends in any case, as a multiple of the modes wanted."""
PESSIMISM = 3.0
"""What the bounds on the operator's errors are above those of the Ritz values of K, at least."""
ZERO_FRACTION = 1e-8
"""Share of the last wanted eigenvalue below which one is zero, and its error absolute."""
ROUNDING_FRACTION = 1e-3
"""Share of the shift by which rounding may take a small eigenvalue below zero."""
ROUNDING = 1e-11
"""Error of an eigenvalue by rounding, as a share of the shift."""
RESOLVED = 1e-2
"""Share (squared) of the residual in the image of a Ritz vector below which it is resolved."""


@dataclass
class Lanczos:
    """Outcome of the iteration.

    Attributes
    ----------
    values
        (k,) Ritz values [rad^2/s^2], ascending.
    vectors
        (local, k) mass-orthonormal Ritz vectors of their span, row-major.
    errors
        (requested,) estimated relative errors of the lowest values; none if there are too few.
    solves, blocks
        Number of right-hand sides solved, and of the blocks that they came in.
    resonant
        Whether the shift is so close to an eigenvalue that its mode drowns the others: then there
        are no values and vectors.
    """

    values: Array
    vectors: Array
    errors: Array
    solves: int
    blocks: int
    resonant: bool = False


def lanczos(
    system: System,
    inverse: Inverse,
    start: Array,
    requested: int,
    width: int,
    tolerance: float,
    first_look: int,
) -> Lanczos:
    """Lowest elastic modes by the block Lanczos iteration of (K - mu M)^-1 M.

    Parameters
    ----------
    inverse
        Exact, with the shift mu between zero and the last wanted eigenvalue.
    start
        (local, b) first block, see `mixed` and `solver.subspace.start.start_block`.
    requested
        Number of modes to become accurate.
    width
        Number of modes to return, as far as there are so many.
    tolerance
        Relative eigenvalue error to stop at.
    first_look
        Dimension of the space at the first look at its Ritz values.

    Notes
    -----
    Every block is made orthogonal to all before it: so near to an eigenvalue the recurrence alone
    loses orthogonality within three steps.  The stiffness projected on the Ritz vectors of the
    operator follows from that of the last block, so the Ritz values of K itself cost little more.
    """
    columns = start.shape[1]
    longest = min(LONGEST * (requested + columns), system.n_dofs)
    basis = _Basis(system, inverse, start, longest + columns)
    looks = _Looks(tolerance, first_look, columns)
    while basis.remainder.shape[1] and basis.size < longest:
        basis.extend()
        if basis.blocks == 1 and basis.remainder.shape[1] < min(columns, longest - basis.size):
            none = np.empty(0)
            return Lanczos(none, start[:, :0], none, basis.size, basis.blocks, resonant=True)
        if basis.size < looks.next:
            continue
        errors, last = basis.outlook(requested)
        # Beyond most wanted modes the shift would take long to find the first ones.
        too_high = inverse.shift > HIGHEST_SHIFT * last
        if too_high or looks.accurate(basis.size, float(np.max(errors)) if len(errors) else np.inf):
            break
    else:
        errors, _ = basis.outlook(requested)
    ritz_values, vectors = basis.ritz_pairs(width)
    return Lanczos(ritz_values, vectors, errors, basis.size, basis.blocks)


def mixed(
    system: System,
    values: Array,
    vectors: Array,
    requested: int,
    shift: float,
    tolerance: float,
    columns: int | None = None,
) -> tuple[Array, int]:
    """A first block (local, b) of approximate modes, and when to look first.

    Parameters
    ----------
    values, vectors
        (q,) and (local, q) approximate pairs, orthogonal to the rigid motions, q >= requested.
    columns
        Width of the block, if modes are not so near as those of HCMS.
    """
    count, look = requested, 1.0
    if tolerance <= ROUGH:
        count, look = min(len(values), int(MIXED * requested)), FIRST_LOOK
    modes = vectors[:, :count]
    columns = min(columns or _columns(requested), requested)
    signs = _signs(system, modes)
    return _mixture(values[:count], modes, signs, shift, columns), int(look * count)


def _columns(requested: int) -> int:
    """Width of a block: few modes in each column, and whole vector registers."""
    narrow = max(-(-requested // MIXED_IN_COLUMN), FEWEST_COLUMNS)
    return min(-(-narrow // 8) * 8, COLUMNS)


class _Looks:
    """When to look at the Ritz values, which costs a dense eigenproblem each time.

    Attributes
    ----------
    next
        Dimension at the next look.
    """

    def __init__(self, tolerance: float, first: int, columns: int) -> None:
        self.next = first
        self._columns = columns
        self._tolerance = tolerance
        self._before: tuple[int, float] | None = None

    def accurate(self, size: int, error: float) -> bool:
        """Whether the `error` found is small enough; else the next look is planned."""
        if error <= self._tolerance:
            return True
        if not np.isfinite(error):
            self.next = size + 1
            return False
        error = min(error, 1.0)
        rate = DECADES / self._columns
        if self._before is not None:
            rate = max(rate / 2.0, np.log10(self._before[1] / error) / (size - self._before[0]))
        self._before = size, error
        # A little early: one block too many costs more than one look.
        self.next = size + max(1, int(0.8 * np.log10(error / self._tolerance) / rate))
        return False


class _Basis:
    """Orthonormal basis of the Krylov space, with the projected operator.

    Attributes
    ----------
    size, blocks
        Dimension reached, and with how many blocks.
    remainder
        (local, b) the orthonormal block that comes next.
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
        self._last = slice(0, 0)
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
        if is_cancelled(gram, overlap):
            # The shift is close to an eigenvalue; twice is enough.
            overlap += self._sweep(image)
            mass_image = system.times_mass(image)
            gram = system.inner(image, mass_image)
        diagonal = overlap[self._rigid + here.start :]
        self._operator[here, here] = 0.5 * (diagonal + diagonal.T)
        self._continue_with(image, mass_image, gram)
        self._last = here

    def _sweep(self, image: Array) -> Array:
        """Make `image` orthogonal to the rigid motions and the basis; returns what it held."""
        overlap = self._vectors.inner(self._system.times_mass(image))
        self._vectors.remove(overlap, image)
        return overlap

    def _continue_with(self, block: Array, mass_block: Array, gram: Array) -> None:
        """Q and M Q with Q^T M Q = I and Q R = `block`, and R, come next."""
        system = self._system
        weights, condition = bcast_from_root(system.comm, lambda: orthonormal(gram))
        self.remainder = block @ weights
        self._mass_remainder = mass_block @ weights
        self._coupling = weights.T @ gram
        if condition <= WELL_CONDITIONED:
            # Twice is enough.
            again = system.inner(self.remainder, system.times_mass(self.remainder))
            weights, _ = bcast_from_root(system.comm, lambda: orthonormal(again))
            self.remainder = self.remainder @ weights
            self._mass_remainder = system.times_mass(self.remainder)
            self._coupling = system.inner(self._mass_remainder, block)

    def outlook(self, requested: int) -> tuple[Array, float]:
        """Estimated relative errors (requested,) of the lowest eigenvalues, and the last of these.

        None and infinity as long as there are too few.
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
        values = values[:requested]
        size = np.maximum(values, ZERO_FRACTION * values[-1])
        error = square[:requested] / distance * (values - mu) ** 2 / size
        return error / PESSIMISM + ROUNDING * mu / size, float(values[requested - 1])

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


def _signs(system: System, modes: Array) -> Array:
    """Signs (k,) that make each mode point along one fixed pattern over the rows.

    LAPACK finds a mode with either sign, as rounding has it, which differs with the number of
    threads.  Another mixture would agree to the tolerance; the same one agrees to rounding.
    """
    pattern = np.cos(np.arange(3.0 * system.start, 3.0 * system.stop))
    along = system.inner(pattern[:, None], modes)[0]
    return np.where(along < 0.0, -1.0, 1.0)


def _mixture(values: Array, modes: Array, signs: Array, shift: float, columns: int) -> Array:
    """The modes in few columns (local, b), those next to each other in different ones.

    Those far from the shift, which need most steps, enter with most weight.
    """
    count = len(values)
    weight = np.abs(values - shift) ** END_WEIGHT
    weight = np.maximum(weight, LEAST_WEIGHT * weight.max())
    number = np.arange(count)
    mixture = np.zeros((count, columns))
    mixture[number, number % columns] = signs * weight / weight.max()
    return np.asarray(modes @ mixture)


def _lowest(inverted: Array, shift: float, count: int) -> tuple[NDArray[np.int64], Array]:
    """Numbers and values of the `count` lowest eigenvalues shift + 1 / inverted, none negative.

    Those of motions with hardly any stiffness are zero but for rounding; what they are in truth is
    for the stiffness to say.
    """
    values = shift + 1.0 / inverted
    possible = np.flatnonzero(values > -ROUNDING_FRACTION * abs(shift))
    order = possible[np.argsort(values[possible])][:count]
    return order, values[order]
