"""First step of the training (section 7.1.3): where the trees split, from a subset of the rows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import ExtraTreesRegressor, RandomForestRegressor

from dataset_gen.element import Array
from forests.scaling import FEATURES, Features

GROWERS = {"random": RandomForestRegressor, "extra": ExtraTreesRegressor}

SPLIT_FEATURES = 5
"""Features that a split of a random forest chooses from, so that its trees differ."""


@dataclass(frozen=True)
class Tree:
    """Splits of one tree as flat arrays over its nodes; node 0 is the root.

    A row goes to `left` if its float32 feature is <= the threshold, else to `right`. Leaves have
    `left` -1, and `leaf` numbers them; it is -1 elsewhere.
    """

    feature: NDArray[np.int32]
    threshold: Array
    left: NDArray[np.int32]
    right: NDArray[np.int32]
    leaf: NDArray[np.int32]

    @property
    def leaves(self) -> int:
        """Number of leaves."""
        return int(self.leaf.max()) + 1


def flatten(tree: Any) -> Tree:
    """Arrays of a fitted scikit-learn tree (its `tree_`)."""
    left = tree.children_left.astype(np.int32)
    leaf = np.where(left < 0, np.cumsum(left < 0) - 1, -1).astype(np.int32)
    return Tree(
        feature=np.where(left < 0, 0, tree.feature).astype(np.int32),
        threshold=np.where(left < 0, 0.0, tree.threshold),
        left=left,
        right=tree.children_right.astype(np.int32),
        leaf=leaf,
    )


def grow(
    features: Features,
    target: Array,
    weight: Array,
    trees: int,
    depth: int,
    min_leaf: int,
    seed: int,
    grower: str,
    workers: int = 1,
) -> list[Tree]:
    """Grow `trees` trees on rows (n, 7), targets (n,) and weights (n,)."""
    forest = GROWERS[grower](
        n_estimators=trees,
        max_depth=depth,
        min_samples_leaf=min_leaf,
        random_state=seed,
        n_jobs=workers,
        bootstrap=False,
        max_features=FEATURES if grower == "extra" else SPLIT_FEATURES,
    )
    forest.fit(features, target, sample_weight=weight)
    return [flatten(estimator.tree_) for estimator in forest.estimators_]
