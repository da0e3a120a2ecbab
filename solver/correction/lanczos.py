"""Block Lanczos iteration around a shift inside the spectrum.

It may begin from anything.  Approximate modes are mixed into few columns, each of which holds modes
that lie far apart: a Krylov space of them holds all the modes again, and what their errors have in
common is removed from all of them by every solve.  It takes about half the right-hand sides that
correcting each mode by itself takes.
"""

from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array
from carillon.fem.block import degrees_of_freedom
from solver.assembly.system import System
from solver.correction.krylov import KrylovBasis
from solver.correction.shift import MOST
from solver.linear import Inverse
from solver.subspace.start import start_block

DECADES = 2.0
"""Decades by which a block reduces the error at least, assumed until two looks have measured it."""
HIGHEST_SHIFT = 0.8
"""Largest shift, as a share of the last requested eigenvalue."""
LONGEST = 4
"""Largest dimension of the space, as a multiple of the modes requested."""
COLUMNS, FEWEST_COLUMNS = 64, 16
"""Greatest and least width of the block. A narrow one takes fewer right-hand sides, a wide one less
time for each."""
MIXED_IN_COLUMN = 4
"""Number of requested modes in a column, which the Krylov space has to separate."""
END_WEIGHT = 2.0
"""Exponent of a mode's distance to the shift, by which it enters the first block."""
LEAST_WEIGHT = 1e-3
"""Least weight of a mode as a share of the greatest, since the shift may be an eigenvalue."""
MIXED = 1.15
"""Modes that enter the block as a multiple of those requested, in case some are out of order."""
ROUGH = 1e-3
"""Tolerance above which only requested modes enter, so that fewer steps separate them."""
FIRST_LOOK = 1.25
"""Dimension of the space at the first look at its Ritz values, as a multiple of the modes mixed."""


@dataclass
class Lanczos:
    """Outcome of the iteration."""

    values: Array
    """(k,) Ritz values [rad^2/s^2], ascending."""
    vectors: Array
    """(local, k) mass-orthonormal Ritz vectors of their span, row-major."""
    errors: Array
    """(requested,) estimated relative errors of the lowest values; none if there are too few."""
    solves: int
    blocks: int
    """Number of right-hand sides solved, and of the blocks that they came in."""
    resonant: bool = False
    """Whether the shift is so close to an eigenvalue that its mode drowns the others: then there
    are no values and vectors."""
    too_high: bool = False
    """Whether the iteration ended early since the shift lies beyond most wanted eigenvalues."""


def lanczos(
    system: System,
    inverse: Inverse,
    start: Array,
    requested: int,
    width: int,
    tolerance: float,
    first_look: int,
    seed: int = 0,
) -> Lanczos:
    """Lowest elastic modes by the block Lanczos iteration of (K - mu M)^-1 M.

    Parameters
    ----------
    inverse
        Exact, with the shift mu between zero and the last wanted eigenvalue.
    start
        (local, b) first block, see `starting_block.mixed` and `solver.subspace.start.start_block`.
    width
        Number of modes to return, as far as there are so many.
    seed
        Of the random vectors that go on where a block is exhausted.

    Notes
    -----
    A space that cannot grow although more is wanted is invariant; random vectors orthogonal to it
    then go on.  The eigenvalues below the shift are known by inertia: as long as the space holds
    fewer, copies of repeated ones are missing, whatever the errors are.

    Every block is made orthogonal to all before it: so near to an eigenvalue the recurrence alone
    loses orthogonality within three steps.  The stiffness projected on the Ritz vectors of the
    operator follows from that of the last block, so the Ritz values of K itself cost little more.
    """
    columns = start.shape[1]
    elastic = system.n_dofs - system.rigid.shape[1]
    longest = min(LONGEST * (requested + columns), elastic)
    basis = KrylovBasis(system, inverse, start, longest + columns)
    looks = _Looks(tolerance, first_look, columns)
    too_high = False
    while basis.size < longest:
        if not basis.remainder.shape[1]:
            basis.go_on_with(start_block(system, min(columns, elastic - basis.size), seed))
            seed += 1
            continue
        basis.extend()
        if basis.blocks == 1 and basis.remainder.shape[1] < min(columns, longest - basis.size):
            none = np.empty(0)
            return Lanczos(none, start[:, :0], none, basis.size, basis.blocks, resonant=True)
        if basis.size < looks.next:
            continue
        errors, last = basis.outlook(requested)
        too_high = is_too_high(system, inverse, requested, last)
        if too_high or looks.accurate(basis.size, float(np.max(errors)) if len(errors) else np.inf):
            break
    else:
        errors, _ = basis.outlook(requested)
    ritz_values, vectors = basis.ritz_pairs(width)
    return Lanczos(ritz_values, vectors, errors, basis.size, basis.blocks, too_high=too_high)


def is_too_high(system: System, inverse: Inverse, requested: int, last: float) -> bool:
    """Whether it would take long to find the first modes with this shift.

    Where eigenvalues are crowded, as those of symmetric solids, a good shift may lie close below
    the last one, so that those below it are counted as well. `last` is about the last of the
    `requested` elastic eigenvalues.
    """
    below = inverse.negative - system.rigid.shape[1]
    return inverse.shift > HIGHEST_SHIFT * last and below > MOST * requested


class _Looks:
    """When to look at the Ritz values, which costs a dense eigenproblem each time."""

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


def _signs(system: System, modes: Array) -> Array:
    """Signs (k,) that make each mode point along one fixed pattern over the nodes of the mesh.

    LAPACK finds a mode with either sign, as rounding has it, which differs with the number of
    threads.  Another mixture would agree to the tolerance; the same one agrees to rounding. Rows
    differ with the number of ranks, nodes do not.
    """
    pattern = np.cos(degrees_of_freedom(system.nodes))
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
