"""Second step of the training (section 7.1.3): a linear function in every leaf, from all rows.

What a leaf needs to know of its rows are sums, so parts of a dataset just add, and memory does not
grow with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Index
from forests.layout import pack
from forests.model import Forests
from forests.scaling import FEATURES, PATTERNS, Features
from forests.training.moments import ENTRIES, WEIGHT, solve
from forests.training.structure import Rows, Tree

THIN = 10
"""Rows below which a leaf takes the bounds of its answers from an ancestor."""
ANCESTOR_ROWS = 64
"""Rows of the ancestor that a leaf leans on, at least."""


@dataclass(frozen=True)
class Leaves:
    """Linear functions of one tree's leaves."""

    coefficients: Array
    """(leaves, 8) slopes of the seven features and the constant."""
    low: Array
    high: Array
    """(leaves,) range of the targets seen in the leaf, which bounds its answers."""


@dataclass(frozen=True)
class Sums:
    """What the rows seen so far mean for each leaf or node."""

    moments: Array
    """(n, 45) see `moments`."""
    rows: Index
    """(n,) how many."""
    low: Array
    high: Array
    """(n,) range of their targets."""

    @classmethod
    def nothing(cls, count: int) -> Sums:
        """Sums over no rows."""
        return cls(
            np.zeros((count, ENTRIES)),
            np.zeros(count, dtype=np.int64),
            np.full(count, np.inf),
            np.full(count, -np.inf),
        )


@numba.njit(cache=True, nogil=True)
def find_leaves(
    features: Features,
    pattern: NDArray[np.uint8],
    feature: NDArray[np.int32],
    threshold: Array,
    left: NDArray[np.int32],
    right: NDArray[np.int32],
    leaf: NDArray[np.int32],
    roots: NDArray[np.int32],
) -> NDArray[np.int32]:
    """Leaf number (n,) of each row (n, 7) float32 with its void pattern (n,)."""
    leaf_numbers = np.empty(len(features), dtype=np.int32)
    for row in range(len(features)):
        node = roots[pattern[row]]
        while left[node] >= 0:
            go_left = features[row, feature[node]] <= threshold[node]
            node = left[node] if go_left else right[node]
        leaf_numbers[row] = leaf[node]
    return leaf_numbers


def leaf_of(tree: Tree, features: Features, pattern: NDArray[np.uint8]) -> NDArray[np.int32]:
    """Leaf number (n,) of each row (n, 7) float32 with its void pattern (n,)."""
    return np.asarray(
        find_leaves(
            features,
            pattern,
            tree.feature,
            tree.threshold,
            tree.left,
            tree.right,
            tree.leaf,
            tree.roots,
        )
    )


@numba.njit(cache=True, nogil=True)
def _accumulate(
    features: Features,
    target: Array,
    weight: Array,
    leaf_numbers: NDArray[np.int32],
    moments: Array,
    rows: Index,
    low: Array,
    high: Array,
) -> None:
    values = np.empty(FEATURES + 2)
    for row in range(len(leaf_numbers)):
        leaf = leaf_numbers[row]
        for k in range(FEATURES):
            values[k] = features[row, k]
        values[FEATURES] = 1.0
        values[FEATURES + 1] = target[row]
        sums = moments[leaf]
        entry = 0
        for i in range(FEATURES + 2):
            scaled = weight[row] * values[i]
            for j in range(i + 1):
                sums[entry] += scaled * values[j]
                entry += 1
        rows[leaf] += 1
        low[leaf] = min(low[leaf], target[row])
        high[leaf] = max(high[leaf], target[row])


def add_rows(sums: Sums, tree: Tree, rows: Rows) -> None:
    """Add rows to the sums of a tree's leaves."""
    leaf_numbers = leaf_of(tree, rows.features, rows.pattern)
    _accumulate(
        rows.features,
        rows.target,
        rows.weight,
        leaf_numbers,
        sums.moments,
        sums.rows,
        sums.low,
        sums.high,
    )


@numba.njit(cache=True)
def _gather(parent: Index, moments: Array, rows: Index, low: Array, high: Array) -> None:
    """Add every node to its parent; parents come before their children."""
    for node in range(len(parent) - 1, -1, -1):
        above = parent[node]
        if above >= 0:
            moments[above] += moments[node]
            rows[above] += rows[node]
            low[above] = min(low[above], low[node])
            high[above] = max(high[above], high[node])


def _over_nodes(tree: Tree, sums: Sums) -> tuple[Sums, Index]:
    """Sums over the rows below each node, and the parent (nodes,) of each, -1 for roots."""
    nodes = Sums.nothing(len(tree.left))
    last, inner = tree.left < 0, np.flatnonzero(tree.left >= 0)
    for name in ("moments", "rows", "low", "high"):
        getattr(nodes, name)[last] = getattr(sums, name)
    parent = np.full(len(tree.left), -1)
    parent[tree.left[inner]] = parent[tree.right[inner]] = inner
    _gather(parent, nodes.moments, nodes.rows, nodes.low, nodes.high)
    return nodes, parent


def solve_leaves(tree: Tree, sums: Sums, prior: float) -> Leaves:
    """Weighted linear regression in every leaf.

    Parameters
    ----------
    sums
        Over the rows of each leaf.
    prior
        Rows that the nearest ancestor with `ANCESTOR_ROWS` counts for in a leaf's regression. A
        leaf with few rows, or with rows that leave a slope open, so falls back to what holds around
        it, and one without rows takes the ancestor's function.
    """
    nodes, parent = _over_nodes(tree, sums)
    leaves = np.flatnonzero(tree.left < 0)
    ancestor = leaves.copy()
    while True:
        climbing = (parent[ancestor] >= 0) & (
            (ancestor == leaves) | (nodes.rows[ancestor] < ANCESTOR_ROWS)
        )
        if not climbing.any():
            break
        ancestor[climbing] = parent[ancestor[climbing]]
    weight = np.maximum(nodes.moments[ancestor, WEIGHT], np.finfo(float).tiny)
    share = (prior / weight)[:, None]
    coefficients = solve(nodes.moments[leaves] + share * nodes.moments[ancestor])
    bounds = np.where(nodes.rows[leaves] < THIN, ancestor, leaves)
    # A root that no row has come to answers 0: the scale itself, or its logarithm's likeness.
    low = np.where(nodes.rows[bounds] > 0, nodes.low[bounds], 0.0)
    high = np.where(nodes.rows[bounds] > 0, nodes.high[bounds], 0.0)
    return Leaves(coefficients, low, high)


def answers_of(tree: Tree, leaves: Leaves, rows: Rows) -> Array:
    """Answers (n,) of a tree to rows, bounded."""
    leaf_numbers = leaf_of(tree, rows.features, rows.pattern)
    coefficients = leaves.coefficients[leaf_numbers]
    linear = (rows.features * coefficients[:, :FEATURES]).sum(axis=1) + coefficients[:, FEATURES]
    return np.asarray(np.clip(linear, leaves.low[leaf_numbers], leaves.high[leaf_numbers]))


def join(void: Sequence[tuple[Tree, Leaves]], filled: Sequence[tuple[Tree, Leaves]]) -> Forests:
    """Put the trees of both forests, equally many, into one set of arrays.

    Raises UserError, see `forests.layout.pack`.
    """
    trees = [tree for tree, _ in (*void, *filled)]
    leaves = [part for _, part in (*void, *filled)]
    nodes = np.cumsum([0] + [len(tree.left) for tree in trees])
    count = np.cumsum([0] + [tree.leaves for tree in trees])

    def shifted(name: str, offsets: Index) -> NDArray[np.int32]:
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
