"""Trees and leaves of two forests in one set of arrays."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from forests.layout import pack
from forests.model import Forests
from forests.scaling import PATTERNS
from forests.training.leaves import Leaves
from forests.training.structure import Tree


def join(void: Sequence[tuple[Tree, Leaves]], filled: Sequence[tuple[Tree, Leaves]]) -> Forests:
    """Put the trees of both forests, equally many, into one set of arrays.

    Raises
    ------
    UserError
        See `forests.layout.pack`.
    """
    trees = [tree for tree, _ in (*void, *filled)]
    leaves = [part for _, part in (*void, *filled)]
    nodes = np.cumsum([0] + [len(tree.left) for tree in trees])
    count = np.cumsum([0] + [tree.leaves for tree in trees])

    def shifted(name: str, offsets: NDArray[np.int64]) -> NDArray[np.int32]:
        parts = [getattr(tree, name) for tree in trees]
        moved = [np.where(part < 0, -1, part + o) for part, o in zip(parts, offsets)]
        return np.concatenate(moved).astype(np.int32)

    records = [np.column_stack([part.coefficients, part.low, part.high]) for part in leaves]
    roots, packed, ordered = pack(
        np.concatenate([tree.feature for tree in trees]),
        np.concatenate([tree.threshold for tree in trees]),
        shifted("left", nodes),
        shifted("right", nodes),
        shifted("leaf", count),
        shifted("roots", nodes).reshape(2, len(void), PATTERNS),
        np.concatenate(records).astype(np.float32),
    )
    return Forests(roots, packed, ordered)
