"""Splits of a tree, limits of its growth, and the rows that it is grown from."""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array
from forests.scaling import PATTERNS, Features


@dataclass(frozen=True)
class Tree:
    """Splits of one tree as flat arrays over its nodes, children after their parents.

    A row starts at the root of its void pattern, (128,) `roots`, and goes to `left` if its float32
    feature is <= the threshold, else to `right`. Leaves have `left` -1, and `leaf` numbers them; it
    is -1 elsewhere.
    """

    feature: NDArray[np.int32]
    threshold: Array
    left: NDArray[np.int32]
    right: NDArray[np.int32]
    leaf: NDArray[np.int32]
    roots: NDArray[np.int32] = field(default_factory=lambda: np.zeros(PATTERNS, dtype=np.int32))

    @property
    def leaves(self) -> int:
        """Number of leaves."""
        return int(self.leaf.max()) + 1

    @property
    def depth(self) -> int:
        """Splits on the longest way from a root to a leaf."""
        level = np.zeros(len(self.left), dtype=np.int64)
        for node in np.flatnonzero(self.left >= 0):
            level[self.left[node]] = level[self.right[node]] = level[node] + 1
        return int(level.max())


@dataclass(frozen=True)
class TreeLimits:
    """What a tree may grow to: leaves, rows a leaf needs, splits from a root to a leaf."""

    max_leaves: int
    min_leaf: int
    depth: int


@dataclass(frozen=True)
class Rows:
    """Rows of one forest: features (n, 7), void patterns, targets and weights (n,)."""

    features: Features
    pattern: NDArray[np.uint8]
    target: Array
    weight: Array

    def __len__(self) -> int:
        return len(self.target)


def rows_together(parts: Sequence[Rows]) -> Rows:
    """Several parts as one; there must be one."""
    names = [field.name for field in fields(Rows)]
    return Rows(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


def tree_of(
    feature: NDArray[Any],
    threshold: Array,
    left: NDArray[Any],
    right: NDArray[Any],
    roots: NDArray[Any],
) -> Tree:
    """A tree from its splits, leaves numbered in the order of their nodes."""
    last = left < 0
    return Tree(
        feature=np.where(last, 0, feature).astype(np.int32),
        threshold=np.where(last, 0.0, threshold),
        left=left.astype(np.int32),
        right=right.astype(np.int32),
        leaf=np.where(last, np.cumsum(last) - 1, -1).astype(np.int32),
        roots=roots.astype(np.int32),
    )
