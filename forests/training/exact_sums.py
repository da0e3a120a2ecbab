"""Sums over rows that do not depend on their order: fixed-point numbers of two integers.

Every product is rounded to two integers on one grid for all rows, and integers add without
rounding. So the sums of a leaf are the same bits for any division of the rows over threads, ranks,
files and restarts.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Index
from carillon.errors import UserError
from forests.layout import CACHE_LINE, aligned, prefetch
from forests.scaling import FEATURES, Features
from forests.training.moments import ENTRIES

SUMMED = ENTRIES - 1
"""Moments of a leaf that are summed: all but that of the squared target, the last one, which no
coefficient needs."""
DIGITS = 36
"""Bits of the lower integer between two carries."""
CARRY_ROWS = 1 << 27
"""Rows after which the lower integers are carried: 2^27 of 2^35 each stay below 2^63."""
LOGARITHM_BITS = 18
"""Bits behind the binary point in the upper integer, where features and targets are logarithms of
ratios. Each is below 18, so that 10^11 rows of the largest products stay below 2^63."""
RATIO_BITS = -2
"""Bits behind the binary point in the upper integer, where features and targets are ratios, which
count as `MOST` at most."""
MOST = 131072.0
"""Largest feature or target [1] that is summed; a larger ratio counts as this one."""
AHEAD = 8
"""Rows ahead of which the sums of a leaf are asked for from memory."""
FULL = 1 << 62
"""Upper integer from which on the sums have no room left."""
_MAGIC = 1.5 * 2.0**52
_MAGIC_BITS = int(np.array(_MAGIC).view(np.int64))


@dataclass
class Sums:
    """Sums of the moments of each leaf's rows, their number, and the range of their targets."""

    bits: int
    """Bits behind the binary point of the upper integers."""
    moments: Index
    """(n, 2, 44) upper and lower integers, see `moments`."""
    others: Index
    """(n, 4) what else is known of the rows of a leaf, side by side in memory: their number, and
    the bits of the range of their targets."""
    pending: int = 0
    """Rows added since the last carry."""

    @classmethod
    def nothing(cls, count: int, bits: int = LOGARITHM_BITS) -> "Sums":
        """Sums over no rows."""
        sums = cls(bits, aligned((count, 2, SUMMED), np.int64), aligned((count, 4), np.int64))
        sums.clear()
        return sums

    @property
    def rows(self) -> Index:
        """(n,) number of each leaf's rows."""
        return self.others[:, 0]

    @property
    def low(self) -> Array:
        """(n,) least target of each leaf's rows."""
        return self.others.view(np.float64)[:, 1]

    @property
    def high(self) -> Array:
        """(n,) largest target of each leaf's rows."""
        return self.others.view(np.float64)[:, 2]

    def clear(self) -> None:
        """Forget all rows."""
        self.moments[:], self.others[:] = 0, 0
        self.low[:], self.high[:] = np.inf, -np.inf
        self.pending = 0

    def arrays(self) -> Iterator[tuple[str, NDArray[np.generic]]]:
        """The arrays by name, as they add up over ranks and lie in files."""
        for name in ("moments", "rows", "low", "high"):
            yield name, getattr(self, name)

    def add(
        self,
        leaf_numbers: NDArray[np.int32],
        features: Features,
        target: Array,
        weight: Array,
    ) -> None:
        """Add rows, each to the sums of its leaf.

        Raises UserError if the sums have no room left.
        """
        if self.pending + len(target) > CARRY_ROWS:
            self.carry()
        others = (self.others, self.others.view(np.float64))
        lines = self.moments.reshape(-1, CACHE_LINE // 8)
        rows = (leaf_numbers, features, target, weight)
        _add(*rows, self.moments, lines, *others, 2.0**self.bits)
        self.pending += len(target)

    def carry(self) -> None:
        """Make the lower integers less than 2^36, and not negative: one form for one sum.

        Raises UserError if the sums have no room left.
        """
        if not _carry(self.moments):
            raise UserError(
                "the sums of a leaf have no room left for more rows; train with more leaves, or "
                "with a smaller uniform weight"
            )
        self.pending = 0

    def values(self) -> Array:
        """(n, 45) moments as floating-point numbers, the last one zero."""
        self.carry()
        upper, lower = (self.moments[:, part].astype(float) for part in (0, 1))
        total = np.zeros((len(upper), ENTRIES))
        total[:, :SUMMED] = np.ldexp(upper + np.ldexp(lower, -DIGITS), -self.bits)
        return total


def bits_of(logarithmic: bool, largest_weight: float) -> int:
    """Bits behind the binary point that leave room for rows up to a weight."""
    return (LOGARITHM_BITS if logarithmic else RATIO_BITS) - int(
        np.ceil(np.log2(max(1.0, largest_weight)))
    )


@numba.njit(cache=True, nogil=True)
def _add(
    leaf_numbers: NDArray[np.int32],
    features: Features,
    target: Array,
    weight: Array,
    moments: Index,
    lines: Index,
    counts: Index,
    ranges: Array,
    scale: float,
) -> None:
    """Add rows; to bring a number onto a grid, one is added whose last bit is the grid's step.

    `lines` is the memory of `moments`, and `ranges` that of `counts`.
    """
    values = np.empty(FEATURES + 2)
    products = np.zeros(SUMMED)
    rounded = np.zeros(SUMMED)
    upper = rounded.view(np.int64)
    rest = np.zeros(SUMMED)
    lower = rest.view(np.int64)
    step = 1.0 / scale
    fine = scale * 2.0**DIGITS
    per_leaf = len(lines) // len(moments)
    for row in range(len(leaf_numbers)):
        leaf = leaf_numbers[row]
        if row + AHEAD < len(leaf_numbers):
            ahead = np.int64(leaf_numbers[row + AHEAD])
            for line in range(per_leaf):
                prefetch(lines, per_leaf * ahead + line)
            prefetch(counts, ahead)
        answer = target[row]
        for k in range(FEATURES):
            values[k] = min(float(features[row, k]), MOST)
        values[FEATURES] = 1.0
        values[FEATURES + 1] = min(answer, MOST)
        entry = 0
        for i in range(FEATURES + 1):
            scaled = weight[row] * values[i]
            for j in range(i + 1):
                products[entry] = scaled * values[j]
                entry += 1
        scaled = weight[row] * values[FEATURES + 1]
        for j in range(FEATURES + 1):
            products[entry] = scaled * values[j]
            entry += 1
        for n in range(SUMMED):
            rounded[n] = products[n] * scale + _MAGIC
        for n in range(SUMMED):
            rest[n] = (products[n] - (rounded[n] - _MAGIC) * step) * fine + _MAGIC
        sums = moments[leaf]
        for n in range(SUMMED):
            sums[0, n] += upper[n] - _MAGIC_BITS
        for n in range(SUMMED):
            sums[1, n] += lower[n] - _MAGIC_BITS
        counts[leaf, 0] += 1
        ranges[leaf, 1] = min(ranges[leaf, 1], answer)
        ranges[leaf, 2] = max(ranges[leaf, 2], answer)


@numba.njit(cache=True, nogil=True)
def _carry(moments: Index) -> bool:
    room = True
    for leaf in range(len(moments)):
        for n in range(SUMMED):
            lower = moments[leaf, 1, n]
            moments[leaf, 0, n] += lower >> DIGITS
            moments[leaf, 1, n] = lower & ((1 << DIGITS) - 1)
            room &= -FULL < moments[leaf, 0, n] < FULL
    return room
