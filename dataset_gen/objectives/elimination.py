"""Order and tables by which a void pattern's stiffness is factorised, three unknowns at a time.

A node's three unknowns stay together: matrices are made of 3x3 tiles between nodes. The order of
the nodes is that of least degree, so the corners of the block, which touch one cell, come first and
the node in the middle last; the factor of the full block then has 215 tiles instead of 378.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from carillon.arrays import Array, Flags, Index
from carillon.fem.block import CELL_NODES, degrees_of_freedom

TILE = 9
"""Numbers of a tile, stored row by row."""


class Links(NamedTuple):
    """Tiles that link each node to others: those of node i are start[i]..start[i + 1]."""

    start: Index
    node: Index
    tile: Index


class FactorStructure(NamedTuple):
    """Structure of a Cholesky factor L whose tiles are stored row by row."""

    rows: Links
    """Tiles left of the diagonal in each row, by ascending node."""
    columns: Links
    """Tiles below the diagonal in each column, by ascending node."""
    diagonal: Index
    """(n,) tile on the diagonal of each row."""
    start: Index
    """(n + 1,) where the updates by each column begin: column k takes L_ik L_jk^T from all ij."""
    updated: Index
    left: Index
    right: Index
    """(p,) the tiles ij, L_ik and L_jk."""


class Sum(NamedTuple):
    """Tiles that are sums of fixed tiles, each times one of the block's weights."""

    start: Index
    """(t + 1,) where the terms of each tile begin."""
    weight: Index
    """(s,) number of the weight of each term."""
    values: Array
    """(9 s,) its fixed tile."""


@dataclass(frozen=True)
class SymbolicFactorisation:
    """Unknowns of a void pattern in the order of elimination."""

    dofs: Index
    """(a,) degrees of freedom of the active nodes among the block's 81, in order."""
    linked: Flags
    """(n, n) whether two of the nodes touch a common filled cell."""
    filled: Flags
    """(n, n) whether the factor has a tile between them."""
    factor: FactorStructure


def _order(cells: Index) -> list[int]:
    """Nodes of the cells (f, 8) by least degree in what is left of the graph."""
    neighbours: dict[int, set[int]] = {}
    for nodes in cells.tolist():
        for node in nodes:
            neighbours.setdefault(node, set()).update(nodes)
    order = []
    while neighbours:
        node = min(neighbours, key=lambda n: (len(neighbours[n]), n))
        front = neighbours.pop(node) - {node}
        for other in front:
            neighbours[other] = (neighbours[other] | front) - {node}
        order.append(node)
    return order


@cache
def elimination_of(mask: int) -> SymbolicFactorisation:
    """Order and structure of the pattern whose filled cells are the set bits of `mask` (1..255)."""
    cells = CELL_NODES[np.flatnonzero(mask >> np.arange(8) & 1)]
    nodes = np.array(_order(cells))
    touched = (nodes[:, None, None] == cells).any(axis=2).astype(int)
    linked = touched @ touched.T > 0
    filled = linked.copy()
    for node in range(len(filled)):
        front = node + 1 + np.flatnonzero(filled[node + 1 :, node])
        filled[np.ix_(front, front)] = True
    return SymbolicFactorisation(degrees_of_freedom(nodes), linked, filled, factor_of(filled))


def factor_of(filled: Flags) -> FactorStructure:
    """Structure of a factor that has the lower tiles of `filled` (n, n)."""
    lower = np.tril(filled)
    number = np.zeros(filled.shape, dtype=np.int64)
    number[lower] = np.arange(lower.sum())
    updates = []
    for k in range(len(filled)):
        front = k + 1 + np.flatnonzero(filled[k + 1 :, k])
        row, column = np.tril_indices(len(front))
        i, j = front[row], front[column]
        updates.append(np.stack([number[i, j], number[i, k], number[j, k]], axis=1))
    updated, left, right = np.concatenate(updates).T
    return FactorStructure(
        rows=_links(np.tril(filled, -1), number),
        columns=_links(np.triu(filled, 1), number.T),
        diagonal=np.diagonal(number).copy(),
        start=_starts(updates),
        updated=updated.copy(),
        left=left.copy(),
        right=right.copy(),
    )


def lower_links(linked: Flags) -> Links:
    """Links of the lower tiles of a matrix, the diagonal included, stored row by row."""
    lower = np.tril(linked)
    number = np.zeros(linked.shape, dtype=np.int64)
    number[lower] = np.arange(lower.sum())
    return _links(lower, number)


def _links(linked: Flags, number: Index) -> Links:
    node = [np.flatnonzero(row) for row in linked]
    return Links(_starts(node), np.concatenate(node), number[linked])


def _starts(parts: list[Any]) -> Index:
    return np.cumsum([0, *map(len, parts)])


def lower_tiles_of(matrices: Array, linked: Flags) -> Array:
    """Tiles (w, t, 9) of symmetric matrices (w, 3 n, 3 n) in the lower half of `linked`."""
    count = matrices.shape[1] // 3
    tiles = matrices.reshape(-1, count, 3, count, 3).swapaxes(2, 3)
    return tiles[:, np.tril(linked)].reshape(len(matrices), -1, TILE)


def sum_of(weights: Sequence[int] | Index, tiles: Array) -> Sum:
    """Sum of tiles (w, t, 9), each with its number of a weight; zero tiles are left out."""
    used = tiles.any(axis=2).T
    term = np.nonzero(used)
    return Sum(
        start=np.concatenate([[0], np.cumsum(used.sum(axis=1))]),
        weight=np.asarray(weights, dtype=np.int64)[term[1]],
        values=tiles.swapaxes(0, 1)[term].ravel(),
    )
