"""Sizes along a merge tree that decide what every merge costs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carillon.fem.elements import Elements
from carillon.fem.model import Solid
from solver.distribution.decomposition import Decomposition
from solver.distribution.tree import Merge, MergeTree

Counts = NDArray[np.float64]
Corners = NDArray[np.int64]

_AXES = 3


@dataclass(frozen=True)
class TreeSizes:
    """What the synthesis has to do at every group and merge.

    Attributes
    ----------
    tree
        The merge tree.
    element_bytes
        Bytes of a cell under way: its nodes, and what its matrices are made from.
    nodes, boundary, crossing
        (groups,) nodes of each group, those that share a cell with a node outside, and the cells
        in which they do.
    boundary_left
        (merges,) part of the joined group's boundary that the left group brings.
    rows_left, rows_right
        (merges,) nodes of either group in cells that touch both.
    pairs_left, pairs_right, pairs_across
        (merges,) pairs of nodes that these cells couple.
    """

    tree: MergeTree
    element_bytes: float
    nodes: Counts
    boundary: Counts
    crossing: Counts
    boundary_left: Counts
    rows_left: Counts
    rows_right: Counts
    pairs_left: Counts
    pairs_right: Counts
    pairs_across: Counts


def sizes_of_solid(
    model: Solid, decomposition: Decomposition, order: NDArray[np.int64]
) -> TreeSizes:
    """Sizes counted in the mesh of a solid, with what `decompose` found for it."""
    row = np.empty(len(order), dtype=np.int64)
    row[order] = np.arange(len(order))
    corners = row[model.connectivity]
    ranges = decomposition.row_ranges()
    groups = [_boundary(corners, *bounds) for bounds in ranges]
    merges = [
        _interface(corners, ranges[step.left], ranges[step.right])
        for step in decomposition.tree.merges
    ]
    boundary_left = [
        float(np.searchsorted(groups[step.group][0], ranges[step.left][1]))
        for step in decomposition.tree.merges
    ]
    columns = np.array(merges, dtype=float).reshape(-1, 5).T
    return TreeSizes(
        decomposition.tree,
        _element_bytes(model.elements),
        np.array([stop - start for start, stop in ranges], dtype=float),
        np.array([len(rows) for rows, _ in groups], dtype=float),
        np.array([cells for _, cells in groups], dtype=float),
        np.array(boundary_left),
        *columns,
    )


def sizes_of_box(parts: int, nodes: float, elements: Elements) -> TreeSizes:
    """Sizes of a box of `parts` cubes, a power of two, of so many `nodes` each.

    Groups are cuboids that are joined along their shortest side; all their faces are taken to touch
    others, as those of most subdomains of a large solid do, but for the box itself. Where groups
    meet, either may have any number of the layers of nodes in an element of the kind of `elements`,
    each number as often as another.
    """
    order = elements.steps
    layers = np.arange(1.0, order + 1.0)
    # Nodes of a plane that share an element with one of it, on average.
    neighbours = (order + 2.0) ** 2
    within = neighbours * np.mean(layers**2)
    across = neighbours * np.mean(layers * layers[::-1])
    levels = parts.bit_length() - 1
    if parts != 1 << levels:
        raise ValueError(f"{parts} parts, expected a power of two")
    sides = [np.full(_AXES, nodes ** (1.0 / _AXES))]
    areas = []
    for _ in range(levels):
        longer = sides[-1].copy()
        axis = int(np.argmin(longer))
        areas.append(float(np.prod(np.delete(longer, axis))))
        longer[axis] *= 2.0
        sides.append(longer)
    tree = _balanced_tree(levels)
    level = np.array(tree.levels())
    volume = np.array([np.prod(side) for side in sides])
    inner = [np.maximum(side - 2.0 * layers.mean(), 0.0) for side in sides]
    surface = volume - np.array([np.prod(side) for side in inner])
    ends = [(side / order - 1.0, side / order + 1.0) for side in sides]
    shell = np.array([np.prod(more) - np.prod(np.maximum(less, 0.0)) for less, more in ends])
    surface[-1] = shell[-1] = 0.0
    area = np.array(areas)[level[parts:] - 1] if levels else np.empty(0)
    return TreeSizes(
        tree,
        _element_bytes(elements),
        volume[level],
        surface[level],
        shell[level],
        0.5 * surface[level[parts:]],
        layers.mean() * area,
        layers.mean() * area,
        within * area,
        within * area,
        across * area,
    )


def _element_bytes(elements: Elements) -> float:
    of_nodes = 8 * elements.node_places.shape[1]
    return float(of_nodes + sum(values[:1].nbytes for values in elements.arrays()))


def _balanced_tree(levels: int) -> MergeTree:
    parts = 1 << levels
    merges: list[Merge] = []
    below = list(range(parts))
    while len(below) > 1:
        joined = []
        for left, right in zip(below[::2], below[1::2], strict=True):
            merges.append(Merge(parts + len(merges), left, right))
            joined.append(merges[-1].group)
        below = joined
    return MergeTree(parts, tuple(merges))


def _inside(corners: Corners, start: int, stop: int) -> NDArray[np.bool_]:
    return (corners >= start) & (corners < stop)


def _boundary(corners: Corners, start: int, stop: int) -> tuple[Corners, int]:
    """Rows of [start, stop) that share a cell with a row outside, and the number of such cells."""
    inside = _inside(corners, start, stop)
    crossing = inside.any(axis=1) & ~inside.all(axis=1)
    return np.unique(corners[crossing][inside[crossing]]), int(crossing.sum())


def _interface(
    corners: Corners, left: tuple[int, int], right: tuple[int, int]
) -> tuple[int, int, int, int, int]:
    """Rows of either group in the cells that touch both, and the pairs of rows these couple."""
    in_left, in_right = _inside(corners, *left), _inside(corners, *right)
    both = in_left.any(axis=1) & in_right.any(axis=1)
    corners, in_left, in_right = corners[both], in_left[both], in_right[both]
    return (
        len(np.unique(corners[in_left])),
        len(np.unique(corners[in_right])),
        _pairs(corners, in_left, in_left),
        _pairs(corners, in_right, in_right),
        _pairs(corners, in_right, in_left),
    )


def _pairs(corners: Corners, first: NDArray[np.bool_], second: NDArray[np.bool_]) -> int:
    """Distinct pairs of a `first` and a `second` corner of the same cell."""
    if not len(corners):
        return 0
    across = first[:, :, None] & second[:, None, :]
    pair = corners[:, :, None] * (1 + corners.max()) + corners[:, None, :]
    return len(np.unique(pair[across]))
