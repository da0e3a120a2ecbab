"""First block of a Lanczos iteration: approximate modes mixed into few columns.

Each column holds modes that lie far apart, which the Krylov space tells apart again.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.assembly.system import System

Array = NDArray[np.float64]

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
