"""Second step of the training (section 7.1.3): a linear function in every leaf, from all rows.

What a leaf needs to know of its rows are sums, so parts of a dataset just add, and memory does not
grow with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Index
from forests.layout import pack
from forests.model import Forests
from forests.scaling import FEATURES, PATTERNS
from forests.training.exact_sums import Sums
from forests.training.moments import ENTRIES, WEIGHT, solve
from forests.training.routing import leaf_of
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


class _NodeSums(NamedTuple):
    """Sums over the rows below each node: see `Sums`, moments (nodes, 45) as numbers."""

    moments: Array
    rows: Index
    low: Array
    high: Array


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


def _over_nodes(tree: Tree, sums: Sums) -> tuple[_NodeSums, Index]:
    """Sums over the rows below each node, and the parent (nodes,) of each, -1 for roots."""
    count, last = len(tree.left), tree.left < 0
    nodes = _NodeSums(
        np.zeros((count, ENTRIES)),
        np.zeros(count, dtype=np.int64),
        np.full(count, np.inf),
        np.full(count, -np.inf),
    )
    for name, values in zip(_NodeSums._fields, (sums.values(), sums.rows, sums.low, sums.high)):
        getattr(nodes, name)[last] = values
    inner = np.flatnonzero(~last)
    parent = np.full(count, -1)
    parent[tree.left[inner]] = parent[tree.right[inner]] = inner
    _gather(parent, *nodes)
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
