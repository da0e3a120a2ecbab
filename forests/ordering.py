"""Overlapping free cell ordering (section 7.1.1): one function serves all eight origins.

Seen from origin i, the neighbours along the three axes are sorted by modulus, e'2 <= e'3 <= e'4
along a, b, c; then `e'5 = i^a^b`, `e'6 = i^b^c`, `e'7 = i^a^c`, `e'8 = i^7` (cell indices as bits).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dataset_gen.element import Array

_AXES = np.array([1, 2, 4])


def cell_order(young: Array) -> NDArray[np.int64]:
    """Cells e'1..e'8 (n, 8 origins, 8) of blocks (n, 8).

    Equal neighbours are sorted by the face diagonal opposite their axis, then to the lower axis: so
    a block and its 48 images give the same moduli in the same order, void cells included.
    """
    origin = np.arange(8)[:, None]
    neighbour = young[:, origin ^ _AXES]
    opposite = young[:, origin ^ 7 ^ _AXES]
    axis = np.broadcast_to(np.arange(3), neighbour.shape)
    sorted_axes = np.lexsort((axis, opposite, neighbour), axis=-1)
    a, b, c = np.moveaxis(_AXES[sorted_axes], -1, 0)
    flips = np.stack([0 * a, a, b, c, a | b, b | c, a | c, 0 * a + 7], axis=-1)
    return np.asarray(flips ^ origin[None])


def ordered_moduli(young: Array) -> Array:
    """Moduli e'1..e'8 (n, 8 origins, 8) of blocks (n, 8)."""
    rows = np.arange(len(young))[:, None, None]
    return np.asarray(young[rows, cell_order(young)])
