"""Rows go down a tree: which leaf each of them comes to."""

from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from forests.layout import FEATURE_BITS, FEATURE_MASK, place_nodes
from forests.scaling import Features
from forests.training.structure import Tree

GROUP = 16
"""Rows that walk down a tree together."""


class PackedTree(NamedTuple):
    """A tree that rows walk down fast: its nodes as those of the trained forests."""

    roots: NDArray[np.int32]
    """(128,) see `forests.training.structure.Tree`."""
    thresholds: NDArray[np.float32]
    links: NDArray[np.int32]
    """(nodes, 2) the thresholds in column 0, the links in column 1, see `forests.layout.NODE`."""


def packed(tree: Tree) -> PackedTree:
    """Bring a tree's nodes into the order in which rows come to them.

    Raises UserError if there are too many.
    """
    position, nodes = place_nodes(
        tree.feature, tree.threshold, tree.left, tree.right, tree.leaf, tree.roots
    )
    return PackedTree(
        position[tree.roots].astype(np.int32),
        nodes.view(np.float32).reshape(-1, 2),
        nodes.view(np.int32).reshape(-1, 2),
    )


@numba.njit(cache=True, nogil=True)
def find_leaves(
    features: Features,
    pattern: NDArray[np.unsignedinteger[Any]],
    roots: NDArray[np.int32],
    thresholds: NDArray[np.float32],
    links: NDArray[np.int32],
) -> NDArray[np.int32]:
    """Leaf number (n,) of each row (n, 7 at least) float32 with its void pattern (n,).

    Rows walk in groups, so that the processor waits for the memory of all of them at once.
    """
    leaf_numbers = np.empty(len(features), dtype=np.int32)
    node = np.empty(GROUP, dtype=np.int64)
    for first in range(0, len(features), GROUP):
        rows = min(GROUP, len(features) - first)
        for row in range(rows):
            node[row] = roots[pattern[first + row]]
        walking = rows
        while walking > 0:
            walking = 0
            for row in range(rows):
                link = links[node[row], 1]
                if link >= 0:
                    value = features[first + row, link & FEATURE_MASK]
                    node[row] = (link >> FEATURE_BITS) + (value > thresholds[node[row], 0])
                    walking += 1
        for row in range(rows):
            leaf_numbers[first + row] = ~links[node[row], 1]
    return leaf_numbers


def leaf_of(
    tree: Tree | PackedTree, features: Features, pattern: NDArray[np.unsignedinteger[Any]]
) -> NDArray[np.int32]:
    """Leaf number (n,) of each row (n, 7 at least) float32 with its void pattern (n,)."""
    walked = tree if isinstance(tree, PackedTree) else packed(tree)
    return np.asarray(find_leaves(features, pattern, *walked))
