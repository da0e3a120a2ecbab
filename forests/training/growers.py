"""Ways to grow a tree from rows in memory: scikit-learn's, and splits for linear leaves."""

from collections.abc import Callable
from typing import Any

import numpy as np

from forests.scaling import FEATURES, PATTERNS
from forests.training.structure import Rows, Tree, TreeLimits, tree_of
from forests.training.subtrees import grow_linear

LINEAR = "linear"
"""Grower whose splits leave the least error of linear leaves."""
SPLIT_FEATURES = 5
"""Features that a split of the grower `best` chooses from, so that its trees differ."""


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


GROWERS: dict[str, Callable[[Rows, TreeLimits, int], Tree]] = {
    LINEAR: grow_linear,
    "best": _by_variance("DecisionTreeRegressor", SPLIT_FEATURES),
    "extra": _by_variance("ExtraTreeRegressor", FEATURES),
}
"""Ways to grow trees; `best` is that of the paper and of random forests."""
