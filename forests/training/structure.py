"""First step of the training (section 7.1.3): where a tree splits, from a subset of the rows."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array
from forests.scaling import FEATURES, PATTERNS, Features
from forests.training.linear_splits import grow_linear

SPLIT_FEATURES = 5
"""Features that a split of the grower `best` chooses from, so that its trees differ."""


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


def flatten(tree: Any) -> Tree:
    """Arrays of a fitted scikit-learn tree (its `tree_`), one root for all void patterns."""
    return tree_of(
        tree.feature, tree.threshold, tree.children_left, tree.children_right, np.zeros(PATTERNS)
    )


def _by_variance(kind: str, split_features: int) -> Callable[..., Tree]:
    """Grower by scikit-learn's estimator of that name, whose splits leave the least variance."""

    def grow(rows: Rows, limits: TreeLimits, seed: int) -> Tree:
        from sklearn import tree  # whose import takes a second, and only training has use of it

        estimator = getattr(tree, kind)(
            max_depth=limits.depth,
            max_leaf_nodes=max(2, limits.max_leaves),
            min_samples_leaf=limits.min_leaf,
            max_features=split_features,
            random_state=seed,
        )
        estimator.fit(rows.features, rows.target, sample_weight=rows.weight)
        return flatten(estimator.tree_)

    return grow


def _by_linear_fit(rows: Rows, limits: TreeLimits, seed: int) -> Tree:
    """Grower whose splits leave the least error of linear leaves, see `linear_splits`."""
    generator = np.random.default_rng(seed)
    order = generator.permutation(len(rows))
    order = order[np.argsort(rows.pattern[order], kind="stable")]
    present, starts = np.unique(rows.pattern[order], return_index=True)
    splits = grow_linear(
        rows.features,
        rows.target,
        rows.weight,
        order,
        np.append(starts, len(rows)),
        limits.max_leaves,
        limits.min_leaf,
        limits.depth,
        generator,
    )
    # A pattern without rows takes the root of the one that differs from it in the fewest cells.
    bits = np.arange(PATTERNS)[:, None] >> np.arange(FEATURES) & 1
    differing = (bits[:, None] != bits[present]).sum(axis=2)
    return tree_of(*splits, roots=differing.argmin(axis=1))


GROWERS: dict[str, Callable[[Rows, TreeLimits, int], Tree]] = {
    "linear": _by_linear_fit,
    "best": _by_variance("DecisionTreeRegressor", SPLIT_FEATURES),
    "extra": _by_variance("ExtraTreeRegressor", FEATURES),
}
"""Ways to grow trees; `best` is that of the paper and of random forests."""
