"""Trees whose splits are chosen for what their leaves hold: linear functions.

A regression tree of scikit-learn takes the split that leaves the least variance, as if its leaves
were constant, and so spends most splits on trends that a linear leaf follows anyway. Here a split
is the one that leaves the least error of two linear fits. Each void pattern, seen from the origin,
has a root of its own; splits are made where they gain most until the leaves are used up.
"""

from heapq import heappop, heappush

import numba
import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Index
from forests.scaling import FEATURES, Features
from forests.training.moments import ENTRIES, fit_errors, products

BINS = 16
"""Candidate thresholds of a feature, plus one: quantiles of rows drawn from the node."""
QUANTILE_ROWS = 512

SPLIT_ROWS = 3000
"""Rows at most that a split is chosen from, drawn evenly from the node."""


@numba.njit(cache=True, nogil=True)
def _thresholds(
    features: Features, rows: Index, generator: np.random.Generator, edges: Array, values: Array
) -> None:
    """Quantiles (7, BINS - 1) of rows drawn at random; infinite where there are no more."""
    drawn = min(len(rows), QUANTILE_ROWS)
    for k in range(FEATURES):
        for q in range(drawn):
            values[q] = features[rows[int(generator.random() * len(rows))], k]
        ordered = np.sort(values[:drawn])
        count = 0
        for b in range(1, BINS):
            edge = ordered[b * drawn // BINS]
            new = count == 0 or edge > edges[k, count - 1]
            if new and edge < ordered[-1]:
                edges[k, count] = edge
                count += 1
        edges[k, count:] = np.inf


@numba.njit(cache=True, nogil=True)
def _mean_row(features: Features, target: Array, rows: Index, used: int, centre: Array) -> None:
    centre[:] = 0.0
    step = len(rows) / used
    for q in range(used):
        row = rows[int(q * step)]
        for k in range(FEATURES):
            centre[k] += features[row, k]
        centre[FEATURES] += target[row]
    centre /= used


@numba.njit(cache=True, nogil=True)
def _best_split(
    features: Features,
    target: Array,
    weight: Array,
    rows: Index,
    min_leaf: int,
    generator: np.random.Generator,
) -> tuple[int, float, float]:
    """Feature, threshold and gain of the best split of a node's rows; feature -1 if none gains."""
    used = min(len(rows), SPLIT_ROWS)
    step = len(rows) / used
    centre = np.empty(FEATURES + 1)
    _mean_row(features, target, rows, used, centre)
    edges = np.empty((FEATURES, BINS - 1))
    _thresholds(features, rows, generator, edges, np.empty(QUANTILE_ROWS))
    sums = np.zeros((FEATURES, BINS, ENTRIES))
    count = np.zeros((FEATURES, BINS), dtype=np.int64)
    values, one = np.empty(FEATURES + 2), np.empty(ENTRIES)
    for q in range(used):
        row = rows[int(q * step)]
        products(features[row], target[row], weight[row], centre, values, one)
        for k in range(FEATURES):
            chosen = 0
            for b in range(BINS - 1):
                chosen += features[row, k] > edges[k, b]
            for entry in range(ENTRIES):
                sums[k, chosen, entry] += one[entry]
            count[k, chosen] += 1
    whole = sums[0].sum(axis=0)
    # Of the node, and of both sides of every split in turn.
    sides = np.empty((1 + 2 * FEATURES * (BINS - 1), ENTRIES))
    sides[0] = whole
    splits, found = np.empty((FEATURES * (BINS - 1), 2), dtype=np.int64), 0
    for k in range(FEATURES):
        below, rows_below = np.zeros(ENTRIES), 0
        for b in range(BINS - 1):
            if edges[k, b] == np.inf:
                break
            below += sums[k, b]
            rows_below += count[k, b]
            if min(rows_below, used - rows_below) * step >= min_leaf:
                splits[found, 0], splits[found, 1] = k, b
                sides[1 + 2 * found] = below
                sides[2 + 2 * found] = whole - below
                found += 1
    errors = fit_errors(sides[: 1 + 2 * found])
    best, best_feature, best_threshold = 0.0, -1, 0.0
    for split in range(found):
        gain = errors[0] - (errors[1 + 2 * split] + errors[2 + 2 * split])
        if gain > best:
            k, b = splits[split]
            best, best_feature, best_threshold = gain, k, edges[k, b]
    return best_feature, best_threshold, best * step


@numba.njit(cache=True, nogil=True)
def _divide(column: NDArray[np.float32], threshold: float, rows: Index) -> int:
    """Bring the rows that go left to the front; how many they are."""
    first, last = 0, len(rows) - 1
    while first <= last:
        if column[rows[first]] <= threshold:
            first += 1
        else:
            rows[first], rows[last] = rows[last], rows[first]
            last -= 1
    return first


@numba.njit(cache=True, nogil=True)
def grow_linear(
    features: Features,
    target: Array,
    weight: Array,
    rows: Index,
    starts: Index,
    max_leaves: int,
    min_leaf: int,
    depth: int,
    generator: np.random.Generator,
) -> tuple[NDArray[np.int32], Array, NDArray[np.int32], NDArray[np.int32]]:
    """Grow one tree with a root for each group of rows.

    Parameters
    ----------
    features : (n, 7) float32
        Of all rows.
    target, weight : (n,)
        Of all rows.
    rows, starts
        Group g has the rows `rows[starts[g]:starts[g + 1]]`, in random order; `rows` is reordered.
    max_leaves, min_leaf, depth
        Leaves in all, rows a leaf needs, splits from root to leaf.
    generator
        Draws the thresholds that are tried.

    Returns
    -------
    feature, threshold, left, right : (nodes,)
        Splits; group g has root g, leaves have `left` -1.
    """
    roots = len(starts) - 1
    size = roots + 2 * max(0, min(max_leaves, len(rows)) - roots)
    feature, threshold = np.zeros(size, dtype=np.int32), np.zeros(size)
    left, right = np.full(size, -1, dtype=np.int32), np.full(size, -1, dtype=np.int32)
    start, stop = np.zeros(size, dtype=np.int64), np.zeros(size, dtype=np.int64)
    level = np.zeros(size, dtype=np.int64)
    start[:roots], stop[:roots] = starts[:-1], starts[1:]
    candidates = [(0.0, 0) for _ in range(0)]
    first_new, nodes, leaves = 0, roots, roots
    while True:
        for node in range(first_new, nodes):
            own = rows[start[node] : stop[node]]
            if level[node] < depth and len(own) >= 2 * min_leaf:
                k, at, gain = _best_split(features, target, weight, own, min_leaf, generator)
                if k >= 0:
                    feature[node], threshold[node] = k, at
                    heappush(candidates, (-gain, node))
        first_new = nodes
        if len(candidates) == 0 or leaves >= max_leaves:
            break
        _, node = heappop(candidates)
        own = rows[start[node] : stop[node]]
        middle = start[node] + _divide(features[:, feature[node]], threshold[node], own)
        left[node], right[node] = nodes, nodes + 1
        start[nodes], stop[nodes] = start[node], middle
        start[nodes + 1], stop[nodes + 1] = middle, stop[node]
        level[nodes] = level[nodes + 1] = level[node] + 1
        nodes += 2
        leaves += 1
    for node in range(nodes):
        if left[node] < 0:
            feature[node], threshold[node] = 0, 0.0
    return feature[:nodes], threshold[:nodes], left[:nodes], right[:nodes]
