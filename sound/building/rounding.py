"""The nearest materials to a continuous field of moduli."""

from __future__ import annotations

import numpy as np

from carillon.arrays import Array, Index
from carillon.fem.regions import RegionOf

SHARES = tuple(np.linspace(0.1, 0.9, 9))
"""Shares of the solid below the middle of the materials' moduli, in roundings that are tried: a
field is known up to a factor."""


def roundings(field: Array, groups: Index, young: Array) -> list[RegionOf]:
    """Materials (M,) with the moduli `young` (r,) [Pa], ascending, nearest to a field (M,) [Pa].

    The distance is that of logarithms, of a group its mean; each of several factors of the field
    makes a rounding, which are told once if they are equal.

    Examples
    --------
    >>> field = np.array([1.0, 2.0, 8.0, 9.0])
    >>> [each.tolist() for each in roundings(field, np.arange(4), np.array([70e9, 200e9]))]
    [[0, 1, 1, 1], [0, 0, 1, 1], [0, 0, 0, 1]]
    """
    count = int(groups.max()) + 1
    sizes = np.bincount(groups, minlength=count)
    level = np.bincount(groups, np.log(field), minlength=count) / sizes
    own = np.log(young)
    middle = 0.5 * (own[0] + own[-1])
    between = 0.5 * (own[1:] + own[:-1])
    found: dict[bytes, RegionOf] = {}
    for share in SHARES:
        shifted = level + middle - np.quantile(level, share)
        numbers = np.searchsorted(between, shifted).astype(np.uint16)[groups]
        found.setdefault(numbers.tobytes(), numbers)
    return list(found.values())
