"""Splits that are chosen for what leaves hold: linear functions.

A regression tree of scikit-learn takes the split that leaves the least variance, as if its leaves
were constant, and so spends most splits on trends that a linear leaf follows anyway. Here a split
is the one that leaves the least error of two linear fits.

A split depends on the rows of its node, on their order in the dataset, and on the node's key. So it
is the same wherever the node is grown, and whichever nodes are grown before it.
"""

from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Index
from forests.scaling import FEATURES
from forests.training.moments import ENTRIES, fit_errors, products

BINS = 16
"""Candidate thresholds of a feature, plus one: quantiles of rows drawn from the node."""
QUANTILE_ROWS = 512
"""Rows that the quantiles are taken from."""
SPLIT_ROWS = 3000
"""Rows at most that a split is chosen from, one at random from each of as many equal parts."""
ROWS_AT_HAND = 32
"""Rows whose moments are worked out together."""
TARGET, WEIGHT = FEATURES, FEATURES + 1
RECORD = FEATURES + 2
"""Numbers of a row: seven features, target, weight; float32."""
NODE = np.dtype(
    [
        *(("feature", np.int32), ("left", np.int32), ("threshold", float)),
        *(("start", np.int64), ("stop", np.int64), ("level", np.int64)),
        *(("gain", float), ("least", float), ("key", np.uint64)),
    ]
)
"""A node while it grows: its split, and `left` child or -1, the right one follows on that; its rows
start..stop-1; splits above it; what the split gains, 0 if there is none; the least gain of it and
all nodes above; the key that its random numbers come from."""
_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_ONE, _TWO = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
_SHIFTS = tuple(np.uint64(n) for n in (30, 27, 31, 11))
_UNIT = 2.0**-53


@numba.njit(cache=True, nogil=True, inline="always")
def derived(key: np.uint64, number: int) -> np.uint64:
    """Key number `number` that follows from a key (SplitMix64)."""
    z = key + (np.uint64(number) + np.uint64(1)) * _GOLDEN
    z = (z ^ (z >> _SHIFTS[0])) * _ONE
    z = (z ^ (z >> _SHIFTS[1])) * _TWO
    return z ^ (z >> _SHIFTS[2])


@numba.njit(cache=True, nogil=True, inline="always")
def _uniform(key: np.uint64, number: int) -> float:
    """Random number `number` of a key, in 0..1."""
    return float(derived(key, number) >> _SHIFTS[3]) * _UNIT


@numba.njit(cache=True, nogil=True)
def _draw(records: NDArray[np.float32], key: np.uint64, drawn: NDArray[np.float32]) -> int:
    """Write the rows that a split is chosen from; how many they are."""
    used = min(len(records), len(drawn))
    if used == len(records):
        drawn[:used] = records
        return used
    step = len(records) / used
    for q in range(used):
        row = min(int((q + _uniform(key, q)) * step), len(records) - 1)
        drawn[q] = records[row]
    return used


@numba.njit(cache=True, nogil=True)
def _thresholds(rows: NDArray[np.float32], key: np.uint64, edges: Array, values: Array) -> None:
    """Quantiles (7, BINS - 1) of rows drawn at random; infinite where there are no more."""
    drawn = min(len(rows), QUANTILE_ROWS)
    number = SPLIT_ROWS
    for k in range(FEATURES):
        for q in range(drawn):
            values[q] = rows[int(_uniform(key, number) * len(rows)), k]
            number += 1
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
def _add_to_bins(
    rows: NDArray[np.float32], centre: Array, edges: Array, sums: Array, count: Index
) -> None:
    """Write the moments (7, BINS, 45) and the rows (7, BINS) of each feature's bins.

    Some rows at a time, feature by feature, so that all that is added to stays close at hand.
    """
    sums[:] = 0.0
    values, moments = np.empty(FEATURES + 2), np.empty((ROWS_AT_HAND, ENTRIES))
    column, bins = np.empty(ROWS_AT_HAND), np.empty(ROWS_AT_HAND, dtype=np.int64)
    for first in range(0, len(rows), ROWS_AT_HAND):
        here = min(ROWS_AT_HAND, len(rows) - first)
        for q in range(here):
            row = rows[first + q]
            products(row, float(row[TARGET]), float(row[WEIGHT]), centre, values, moments[q])
        for k in range(FEATURES):
            for q in range(here):
                column[q] = rows[first + q, k]
                bins[q] = 0
            for b in range(BINS - 1):
                edge = edges[k, b]
                for q in range(here):
                    bins[q] += column[q] > edge
            for q in range(here):
                to = sums[k, bins[q]]
                for entry in range(ENTRIES):
                    to[entry] += moments[q, entry]
                count[k, bins[q]] += 1


@numba.njit(cache=True, nogil=True)
def _best_split(
    records: NDArray[np.float32],
    key: np.uint64,
    min_leaf: float,
    drawn: NDArray[np.float32],
    sums: Array,
    sides: Array,
) -> tuple[int, float, float]:
    """Feature, threshold and gain of the best split of a node's rows; feature -1 if none gains.

    The last three arrays are room to work in.
    """
    used = _draw(records, key, drawn)
    rows = drawn[:used]
    step = len(records) / used
    centre = np.zeros(FEATURES + 1)
    for q in range(used):
        for k in range(FEATURES + 1):
            centre[k] += rows[q, k]
    centre /= used
    edges = np.empty((FEATURES, BINS - 1))
    _thresholds(rows, key, edges, np.empty(QUANTILE_ROWS))
    count = np.zeros((FEATURES, BINS), dtype=np.int64)
    _add_to_bins(rows, centre, edges, sums, count)
    # Of the node, and of both sides of every split in turn.
    sides[0] = sums[0].sum(axis=0)
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
                sides[2 + 2 * found] = sides[0] - below
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
def _divide(
    records: NDArray[np.float32],
    places: NDArray[np.uint32],
    feature: int,
    threshold: float,
    spare: NDArray[np.float32],
    spare_places: NDArray[np.uint32],
) -> int:
    """Bring the rows that go left to the front, both sides in their order; how many go left."""
    kept, moved = 0, 0
    for row in range(len(records)):
        if records[row, feature] <= threshold:
            if kept < row:
                records[kept] = records[row]
                places[kept] = places[row]
            kept += 1
        else:
            spare[moved] = records[row]
            spare_places[moved] = places[row]
            moved += 1
    records[kept:] = spare[:moved]
    places[kept:] = spare_places[:moved]
    return kept


@numba.njit(cache=True, nogil=True)
def grow_nodes(
    records: NDArray[np.float32],
    places: NDArray[np.uint32],
    nodes: NDArray[Any],
    count: int,
    least: float,
    fewest: int,
    min_leaf: float,
    depth: int,
    fresh: bool,
) -> int:
    """Split nodes, and those that come of them, until no split is left that may be made.

    Parameters
    ----------
    records : (n, 9) float32
        Rows, see `RECORD`; brought into the order of the nodes, with their `places` (n,).
    nodes : of type `NODE`
        The first `count` are there; there must be room for two more for every split.
    least
        Least gain that a node and all above it must have to be split.
    fewest
        Rows that a node must have to be split.
    min_leaf, depth
        Rows that a leaf needs, splits from the root.
    fresh
        Whether the splits of the first `count` nodes are still to be chosen.

    Returns
    -------
    count : int
        Nodes that are there; `-count` if there was no room for more.
    """
    drawn = np.empty((SPLIT_ROWS, RECORD), dtype=np.float32)
    sums = np.empty((FEATURES, BINS, ENTRIES))
    sides = np.empty((1 + 2 * FEATURES * (BINS - 1), ENTRIES))
    spare, spare_places = np.empty_like(records), np.empty_like(places)
    chosen = 0 if fresh else count
    node = 0
    while node < count:
        while chosen < count:
            new = nodes[chosen]
            own = records[new.start : new.stop]
            new.gain = 0.0
            if new.level < depth and len(own) >= 2 * min_leaf:
                feature, threshold, gain = _best_split(own, new.key, min_leaf, drawn, sums, sides)
                if feature >= 0:
                    new.feature, new.threshold, new.gain = feature, threshold, gain
            new.least = min(new.least, new.gain)
            chosen += 1
        here = nodes[node]
        node += 1
        size = here.stop - here.start
        if here.left >= 0 or here.gain <= 0.0 or here.least < least or size < fewest:
            continue
        if count + 2 > len(nodes):
            return -count
        middle = here.start + _divide(
            records[here.start : here.stop],
            places[here.start : here.stop],
            here.feature,
            here.threshold,
            spare,
            spare_places,
        )
        if min(middle - here.start, here.stop - middle) < min_leaf:
            here.gain = here.least = 0.0  # the drawn rows promised more
            continue
        here.left = count
        for side in range(2):
            child = nodes[count]
            child.feature, child.threshold, child.left = 0, 0.0, -1
            child.start = here.start if side == 0 else middle
            child.stop = middle if side == 0 else here.stop
            child.level, child.least = here.level + 1, here.least
            child.key = derived(here.key, side)
            count += 1
    return count
