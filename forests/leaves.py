"""Second step of the training (section 7.1.3): a linear function in every leaf, from all rows.

Normal equations are sums over rows, so parts of a dataset just add.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from dataset_gen.element import Array
from forests.scaling import FEATURES, Features
from forests.structure import Tree

MOMENTS = FEATURES + 2


@dataclass(frozen=True)
class Leaves:
    """Linear functions of one tree's leaves.

    coefficients (leaves, 8): slopes of the seven features and the constant; low and high (leaves,):
    range of the targets seen in the leaf, which bounds its answers.
    """

    coefficients: Array
    low: Array
    high: Array


@numba.njit(cache=True, nogil=True)
def find_leaves(
    features: np.ndarray,
    feature: np.ndarray,
    threshold: np.ndarray,
    left: np.ndarray,
    right: np.ndarray,
    leaf: np.ndarray,
) -> np.ndarray:
    """Leaf number (n,) of each row (n, 7) float32."""
    found = np.empty(len(features), dtype=np.int32)
    for row in range(len(features)):
        node = 0
        while left[node] >= 0:
            go_left = features[row, feature[node]] <= threshold[node]
            node = left[node] if go_left else right[node]
        found[row] = leaf[node]
    return found


def leaf_of(tree: Tree, features: Features) -> np.ndarray:
    """Leaf number (n,) of each row (n, 7) float32."""
    return find_leaves(features, tree.feature, tree.threshold, tree.left, tree.right, tree.leaf)


@numba.njit(cache=True, nogil=True)
def _accumulate(
    features: np.ndarray,
    target: Array,
    weight: Array,
    found: np.ndarray,
    moments: Array,
    low: Array,
    high: Array,
) -> None:
    """Add the weighted products of (x, 1, t) to `moments`, widen the leaves' target ranges."""
    values = np.empty(MOMENTS)
    for row in range(len(found)):
        leaf = found[row]
        for k in range(FEATURES):
            values[k] = features[row, k]
        values[FEATURES] = 1.0
        values[FEATURES + 1] = target[row]
        for i in range(MOMENTS):
            scaled = weight[row] * values[i]
            for j in range(i + 1):
                moments[leaf, i, j] += scaled * values[j]
        low[leaf] = min(low[leaf], target[row])
        high[leaf] = max(high[leaf], target[row])


def fit_leaves(
    tree: Tree, features: Features, target: Array, weight: Array, prior: float
) -> Leaves:
    """Weighted linear regression in every leaf.

    Parameters
    ----------
    features, target, weight : rows (n, 7), (n,), (n,).
    prior : weight of the belief that slopes are zero, in rows that spread as the whole dataset
        does: a leaf with few rows, or with little spread, falls back to its mean.
    """
    count = tree.leaves
    moments = np.zeros((count, MOMENTS, MOMENTS))
    low, high = np.full(count, np.inf), np.full(count, -np.inf)
    _accumulate(features, target, weight, leaf_of(tree, features), moments, low, high)
    total = np.maximum(moments[:, FEATURES, FEATURES], np.finfo(float).tiny)
    mean = moments[:, FEATURES, :FEATURES] / total[:, None]
    target_mean = moments[:, FEATURES + 1, FEATURES] / total
    lower = moments[:, :FEATURES, :FEATURES]
    square = lower + np.tril(lower, -1).transpose(0, 2, 1)
    square = square - total[:, None, None] * mean[:, :, None] * mean[:, None, :]
    cross = moments[:, FEATURES + 1, :FEATURES] - (total * target_mean)[:, None] * mean
    spread = np.maximum(features.astype(float).var(axis=0), 1e-12)
    slopes = np.linalg.solve(square + prior * np.diag(spread), cross[..., None])[..., 0]
    constant = target_mean - (slopes * mean).sum(axis=1)
    return Leaves(np.column_stack([slopes, constant]), low, high)
