"""Combinations of a few materials in the eight cells of a block, up to the cube's symmetries.

The key of a combination is the sum over the cells of (number of the cell's material) x m^(number of
the cell), with m materials. A symmetry makes another key of it; the least of the 48 stands for all.
"""

import numba
import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Index
from carillon.fem.block import symmetries


def places(materials: int) -> Index:
    """Weight (8, 48) of cell j's material in the key of the block's image under symmetry g."""
    return np.ascontiguousarray(np.int64(materials) ** symmetries().T)


def combinations(materials: int) -> int:
    """Number of ways to fill eight cells with so many materials, up to the cube's symmetries.

    Burnside's lemma: the mean over the symmetries of the number that each leaves as they are.
    """
    total = 0
    for image in symmetries():
        cycles = {frozenset(_orbit(image, cell)) for cell in range(8)}
        total += materials ** len(cycles)
    return total // len(symmetries())


def _orbit(image: Index, cell: int) -> list[int]:
    orbit = [cell]
    while (cell := int(image[cell])) != orbit[0]:
        orbit.append(cell)
    return orbit


@numba.njit(cache=True, nogil=True)
def _least_images(materials: int, weights: Index, keys: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Keys of the combinations that are the least of their images, ascending, into `keys`."""
    digits = np.zeros(8, dtype=np.int64)
    count = 0
    for key in range(materials**8):
        least = True
        for g in range(weights.shape[1]):
            image = 0
            for j in range(8):
                image += digits[j] * weights[j, g]
            if image < key:
                least = False
                break
        if least:
            keys[count] = key
            count += 1
        j = 0
        while j < 8:
            digits[j] += 1
            if digits[j] < materials:
                break
            digits[j] = 0
            j += 1
    return keys[:count]


def combination_keys(materials: int) -> NDArray[np.uint32]:
    """Keys (k,) of all combinations, each the least of its images, ascending."""
    keys = np.empty(combinations(materials), dtype=np.uint32)
    return np.asarray(_least_images(materials, places(materials), keys))


def cells_of(keys: NDArray[np.uint32], materials: Array) -> Array:
    """Fine moduli (k, 8) of combinations (k,)."""
    digits = keys[:, None].astype(np.int64) // len(materials) ** np.arange(8) % len(materials)
    return np.asarray(materials[digits])
