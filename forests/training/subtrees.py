"""A tree in parts: its top from a sample of the rows, then subtrees, each from all of its own rows.

Splits are made where they gain most until the leaves are used up. Which ones these are is known
only when all parts are: so all parts grow in rounds, down to a least gain that falls from round to
round, and what was split beyond the leaves is cut off at the end.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray

from carillon.arrays import Array, Index
from forests.scaling import FEATURES, PATTERNS
from forests.training.linear_splits import NODE, RECORD, SPLIT_ROWS, derived, grow_nodes
from forests.training.ranks import Ranks
from forests.training.routing import leaf_of
from forests.training.structure import Rows, Tree, TreeLimits, tree_of

TOP_ROWS = 2 * SPLIT_ROWS
"""Rows of the sample that a node of the top must have to be split."""
_ROOM = 64


def records_of(rows: Rows) -> NDArray[np.float32]:
    """Rows as records (n, 9) of `forests.training.linear_splits.RECORD`."""
    records = np.empty((len(rows), RECORD), dtype=np.float32)
    records[:, :FEATURES] = rows.features
    records[:, FEATURES], records[:, FEATURES + 1] = rows.target, rows.weight
    return records


def _grown(
    records: NDArray[np.float32],
    places: NDArray[np.uint32],
    nodes: NDArray[Any],
    least: float,
    limits: TreeLimits,
    fewest: int = 0,
    share: float = 1.0,
    fresh: bool = False,
) -> NDArray[Any]:
    """Nodes after `grow_nodes`; a row stands for 1 / `share` rows."""
    count = len(nodes)
    while True:
        room = np.empty(2 * count + _ROOM, dtype=NODE)
        room[:count] = nodes[:count]
        min_leaf = limits.min_leaf * share
        count = grow_nodes(
            records, places, room, count, least, fewest, min_leaf, limits.depth, fresh
        )
        if count >= 0:
            return room[:count].copy()
        nodes, count, fresh = room, -count, False


def _root(start: int, stop: int, key: np.uint64, level: int = 0, least: float = np.inf) -> Any:
    return (0, -1, 0.0, start, stop, level, 0.0, least, key)


@dataclass(frozen=True)
class Top:
    """The top of a tree: roots of the void patterns, and the splits of nodes with many rows."""

    nodes: NDArray[Any]
    tree: Tree
    """The same as a tree, whose leaves are the roots of the subtrees."""

    @property
    def leaves(self) -> Index:
        """Nodes that are the roots of subtrees."""
        return np.flatnonzero(self.nodes["left"] < 0)

    def subtree_roots(self) -> NDArray[Any]:
        """The first node of each subtree, without rows yet."""
        least = np.full(len(self.nodes), np.inf)
        inner = np.flatnonzero(self.nodes["left"] >= 0)
        for side in range(2):
            least[self.nodes["left"][inner] + side] = self.nodes["least"][inner]
        roots = [
            _root(0, 0, self.nodes["key"][leaf], self.nodes["level"][leaf], least[leaf])
            for leaf in self.leaves
        ]
        return np.array(roots, dtype=NODE)


def grow_top(sample: Rows, limits: TreeLimits, key: int, rows: int) -> Top:
    """Grow the top of a tree from a sample that stands for so many rows.

    `key`: where its random numbers come from.
    """
    order = np.argsort(sample.pattern, kind="stable")
    present, starts = np.unique(sample.pattern[order], return_index=True)
    stops = [*starts[1:], len(order)]
    keys = [derived(np.uint64(key), int(pattern)) for pattern in present]
    nodes = np.array([_root(*each) for each in zip(starts, stops, keys)], dtype=NODE)
    records = records_of(sample)[order]
    share = len(sample) / rows
    places = np.zeros(len(order), dtype=np.uint32)
    nodes = _grown(records, places, nodes, 0.0, limits, TOP_ROWS, share, fresh=True)
    nodes["least"] /= share
    # A pattern without rows takes the root of the one that differs from it in the fewest cells.
    bits = np.arange(PATTERNS)[:, None] >> np.arange(FEATURES) & 1
    roots = (bits[:, None] != bits[present]).sum(axis=2).argmin(axis=1)
    return Top(nodes, _as_tree(nodes, roots))


def _as_tree(nodes: NDArray[Any], roots: NDArray[Any]) -> Tree:
    left = nodes["left"]
    right = np.where(left < 0, -1, left + 1)
    return tree_of(nodes["feature"], nodes["threshold"], left, right, roots)


@numba.njit(cache=True, nogil=True)
def _sorted_places(numbers: NDArray[np.uint16], starts: Index, places: NDArray[np.uint32]) -> None:
    """Write the rows of each subtree, in order, from its start on."""
    following = starts.copy()
    for row in range(len(numbers)):
        number = numbers[row]
        places[following[number]] = row
        following[number] += 1


class Subtrees:
    """The subtrees that one rank grows, and its rows of them.

    Parameters
    ----------
    top
        What is above them.
    records : (n, 9)
        Rows in the order of the dataset; left as they are.
    numbers : (n,)
        Subtree of each row.
    limits
        Of the whole tree.
    workers
        Threads.
    """

    def __init__(
        self,
        top: Top,
        records: NDArray[np.float32],
        numbers: NDArray[np.uint16],
        limits: TreeLimits,
        workers: int,
    ) -> None:
        self._records, self._limits, self._workers = records, limits, workers
        roots = top.subtree_roots()
        counts = np.bincount(numbers, minlength=len(roots))
        self._starts = np.concatenate([[0], np.cumsum(counts)])
        self._places = np.empty(len(records), dtype=np.uint32)
        _sorted_places(numbers, self._starts[:-1], self._places)
        self.nodes = [roots[number : number + 1] for number in range(len(roots))]
        for own, count in zip(self.nodes, counts, strict=True):
            own["stop"] = count
        self._all(list(np.flatnonzero(counts)), np.inf, fresh=True)

    def grow(self, least: float) -> None:
        """Make all splits that gain so much, as those above them do."""
        numbers = [n for n, nodes in enumerate(self.nodes) if (_open(nodes) >= least).any()]
        self._all(numbers, least)

    def _all(self, numbers: list[int], least: float, fresh: bool = False) -> None:
        run = Parallel(n_jobs=self._workers, prefer="threads", batch_size=1)
        run(delayed(self._one)(number, least, fresh) for number in numbers)

    def _one(self, number: int, least: float, fresh: bool) -> None:
        own = slice(self._starts[number], self._starts[number + 1])
        rows = self._places[own]
        places = np.arange(len(rows), dtype=np.uint32)
        self.nodes[number] = _grown(
            self._records[rows], places, self.nodes[number], least, self._limits, fresh=fresh
        )
        self._places[own] = rows[places]


def _open(nodes: NDArray[Any]) -> Array:
    """Least gains of the nodes that may still be split."""
    return np.asarray(nodes["least"][(nodes["left"] < 0) & (nodes["gain"] > 0)])


def _made(nodes: NDArray[Any]) -> Array:
    """Least gains of the nodes that are split."""
    return np.asarray(nodes["least"][nodes["left"] >= 0])


def grow_rounds(top: Top, own: Subtrees, limits: TreeLimits, ranks: Ranks) -> Iterator[int]:
    """Grow all subtrees, on all ranks, until no split is left that could be among the best.

    Yields how many splits are made, after each round.
    """
    budget = limits.max_leaves - int((top.nodes["level"] == 0).sum())
    while True:
        mine = [np.concatenate([kind(nodes) for nodes in own.nodes]) for kind in (_open, _made)]
        everywhere = ranks.in_order([mine])
        least, count = None, 0
        if ranks.first:
            waiting, made = (np.concatenate(parts) for parts in zip(*everywhere))
            made = np.concatenate([made, _made(top.nodes)])
            least, count = _next_least(waiting, made, budget), len(made)
        least, count = ranks.from_one((least, count))
        yield min(count, budget)
        if least is None:
            return
        own.grow(least)


def _next_least(waiting: Array, made: Array, budget: int) -> float | None:
    """Least gain of the next round; None if no split that is left can be among the best."""
    known = np.concatenate([waiting, made])
    if budget <= 0:
        return None
    if len(known) > budget:
        last = float(np.partition(known, len(known) - budget)[len(known) - budget])
        return last if (waiting >= last).any() and _is_short(waiting, made, last, budget) else None
    return float(np.median(waiting)) if len(waiting) else None


def _is_short(waiting: Array, made: Array, last: float, budget: int) -> bool:
    """Whether splits that wait would have a place before or beside the last one."""
    return bool((waiting > last).any() or (made >= last).sum() < budget)


def assembled(top: Top, subtrees: list[NDArray[Any]], limits: TreeLimits) -> Tree:
    """The tree of the best splits, nodes by levels.

    `subtrees`: nodes of all of them, in the order of the top's leaves.
    """
    parts = [top.nodes, *subtrees]
    offsets = np.concatenate([[0], np.cumsum([len(part) for part in parts])])
    nodes = np.concatenate(parts)
    left = nodes["left"] + np.repeat(offsets[:-1], [len(part) for part in parts])
    left[nodes["left"] < 0] = -1
    # A leaf of the top is the root of its subtree.
    same = np.arange(len(nodes))
    same[top.leaves] = offsets[1:-1]
    roots = np.flatnonzero(top.nodes["level"] == 0)
    splits = np.flatnonzero(left >= 0)
    best = np.lexsort((nodes["key"][splits], nodes["level"][splits], -nodes["least"][splits]))
    keep = np.zeros(len(nodes), dtype=bool)
    keep[splits[best[: max(0, limits.max_leaves - len(roots))]]] = True
    number = np.full(len(nodes), -1)
    level, levels, count = same[roots], [], 0
    while len(level):
        number[level] = np.arange(count, count + len(level))
        count += len(level)
        levels.append(level)
        above = left[level[keep[level]]]
        level = same[np.stack([above, above + 1], axis=1).ravel()]
    order = np.concatenate(levels)
    inner = keep[order]
    to_left, to_right = np.full(count, -1), np.full(count, -1)
    to_left[inner] = number[same[left[order[inner]]]]
    to_right[inner] = number[same[left[order[inner]] + 1]]
    return tree_of(
        nodes["feature"][order], nodes["threshold"][order], to_left, to_right, top.tree.roots
    )


def own_nodes(own: Subtrees, numbers: Iterable[int]) -> dict[int, NDArray[Any]]:
    """Nodes of the subtrees that a rank grows, by number."""
    return {int(number): own.nodes[number] for number in numbers}


def grow_linear(rows: Rows, limits: TreeLimits, key: int) -> Tree:
    """A tree from rows in memory, in the order of the dataset; `key`: of its random numbers."""
    top = grow_top(rows, limits, key, len(rows))
    numbers = leaf_of(top.tree, rows.features, rows.pattern).astype(np.uint16)
    own = Subtrees(top, records_of(rows), numbers, limits, 1)
    for _ in grow_rounds(top, own, limits, Ranks()):
        pass
    return assembled(top, own.nodes, limits)
