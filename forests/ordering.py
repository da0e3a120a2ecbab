"""Overlapping free cell ordering (section 7.1.1): one function serves all eight origins.

Seen from origin i, the neighbours along the three axes are sorted by modulus, e'2 <= e'3 <= e'4
along a, b, c; then `e'5 = i^a^b`, `e'6 = i^b^c`, `e'7 = i^a^c`, `e'8 = i^7` (cell indices as bits).
Equal neighbours are sorted by the face diagonal opposite their axis, then to the lower axis: so a
block and its 48 images give the same moduli in the same order, void cells included.
"""

import numba
import numpy as np

from carillon.arrays import Array, Index

_AXES = np.array([1, 2, 4])


def _flips_of_orders() -> Index:
    """Row of `FLIPS` for each answer of `order_code`; the two impossible answers stay zero."""
    flips = np.zeros((8, 7), dtype=np.int64)
    for code in range(8):
        one_two, one_three, two_three = code & 1, code >> 1 & 1, code >> 2
        rank = [one_two + one_three, 1 - one_two + two_three, 2 - one_three - two_three]
        if sorted(rank) == [0, 1, 2]:
            a, b, c = _AXES[np.argsort(rank)]
            flips[code] = a, b, c, a ^ b, b ^ c, a ^ c, 7
    return flips


FLIPS = _flips_of_orders()
"""Cells e'2..e'8 (8 orders, 7), combined with the origin by exclusive or."""


@numba.njit(inline="always")
def _is_after(young: Array, origin: int, a: int, b: int) -> int:
    """Whether the neighbour along axis a comes after the one along b, a higher axis."""
    one, two = young[origin ^ a], young[origin ^ b]
    opposite_one, opposite_two = young[origin ^ 7 ^ a], young[origin ^ 7 ^ b]
    return int((one > two) | ((one == two) & (opposite_one > opposite_two)))


@numba.njit(inline="always")
def order_code(young: Array, origin: int) -> int:
    """Row of `FLIPS` that holds the order of a block (8,) seen from `origin`; no branches."""
    return (
        _is_after(young, origin, 1, 2)
        | _is_after(young, origin, 1, 4) << 1
        | _is_after(young, origin, 2, 4) << 2
    )
