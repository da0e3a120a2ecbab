"""Forests and blocks made up to measure what an evaluation costs."""

import numba
import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array
from forests.layout import FEATURE_BITS, NODE, aligned, pack
from forests.model import FILLED, HIGH, LOW, RECORD, VOID, Forests, Model
from forests.scaling import FEATURES, PATTERNS, Features, prepare

LARGEST_GPA = 10.0

MOST_VOID = 0.5
"""Share of void cells in the emptiest random blocks, on average."""

PIVOT_ROWS = 9

SPLIT_ROWS = 1 << 20
"""Origins of either kind that splits are chosen from, at most; as many as leaves do."""


def random_blocks(count: int, seed: int = 0) -> Array:
    """Blocks (count, 8) of independent moduli in 0..10 GPa; up to half of the cells are void."""
    generator = np.random.default_rng(seed)
    young = generator.uniform(0.0, LARGEST_GPA, (count, 8))
    void = generator.random(young.shape) < generator.uniform(0.0, MOST_VOID, (count, 1))
    void[:, 0] &= ~void.all(axis=1)
    young[void] = 0.0
    return young


def coherent_blocks(count: int) -> Array:
    """Blocks (count, 8) of a solid, row by row, as a mesh has them: neighbours are alike.

    A ball of 2..10 GPa, stiffness varying smoothly, with a grain of one percent.
    """
    edge = 2
    while True:
        blocks = _ball(edge)
        if len(blocks) >= count:
            return np.ascontiguousarray(blocks[:count])
        edge = max(edge + 1, int(1.05 * edge * (count / max(1, len(blocks))) ** (1 / 3)))


def _ball(edge: int) -> Array:
    """Blocks of a ball in a cube of edge^3 blocks, those void altogether left out."""
    axis = (np.arange(2 * edge) + 0.5) / edge - 1.0
    x, y, z = axis[:, None, None], axis[:, None], axis
    young = 6.0 + 4.0 * np.sin(5.0 * x + 1.0) * np.cos(4.0 * y) * np.sin(3.0 * z + 2.0)
    young *= 1.0 + 0.01 * np.random.default_rng(0).uniform(-1.0, 1.0, young.shape)
    young[x * x + y * y + z * z > 1.0] = 0.0
    cells = young.reshape(edge, 2, edge, 2, edge, 2).transpose(0, 2, 4, 5, 3, 1)
    blocks = cells.reshape(-1, 8)
    return np.asarray(blocks[blocks.any(axis=1)])


@numba.njit(cache=True, nogil=True)
def _splits(
    features: Features, depth: int, generator: np.random.Generator
) -> tuple[NDArray[np.int32], Array]:
    """Features and thresholds (2^depth - 1,) of a complete tree, parents first.

    Each splits its rows (n, 7) about in halves: at the median of some, along a random feature.
    """
    inner = (1 << depth) - 1
    feature = np.zeros(inner, dtype=np.int32)
    threshold = np.zeros(inner)
    rows = np.arange(len(features))
    begin = np.zeros(2 * inner + 1, dtype=np.int64)
    end = np.zeros(2 * inner + 1, dtype=np.int64)
    end[0] = len(rows)
    drawn = np.empty(PIVOT_ROWS)
    for node in range(inner):
        first, last = begin[node], end[node]
        k = int(generator.random() * FEATURES)
        pivot = 0.0
        if last > first:
            for q in range(PIVOT_ROWS):
                drawn[q] = features[rows[first + int(generator.random() * (last - first))], k]
            pivot = np.sort(drawn)[PIVOT_ROWS // 2]
        middle = first
        for q in range(first, last):
            if features[rows[q], k] <= pivot:
                rows[q], rows[middle] = rows[middle], rows[q]
                middle += 1
        feature[node], threshold[node] = k, pivot
        begin[2 * node + 1], end[2 * node + 1] = first, middle
        begin[2 * node + 2], end[2 * node + 2] = middle, last
    return feature, threshold


def complete_forests(trees: int, depth: int) -> Model:
    """Forests of complete trees, 56 bytes a leaf, whose leaves random blocks visit about evenly."""
    generator = np.random.default_rng(0)
    rows = min(SPLIT_ROWS, 8 << depth)
    # A quarter of the origins is void.
    prepared = prepare(random_blocks(rows // 2, seed=1), "log")
    by_kind = [
        prepared.features[prepared.filled == bool(kind)][:rows].copy() for kind in (VOID, FILLED)
    ]
    del prepared
    leaves = 1 << depth
    number = np.arange(2 * leaves - 1, dtype=np.int32)
    inner = number < leaves - 1
    left = np.where(inner, 2 * number + 1, -1).astype(np.int32)
    right = np.where(inner, 2 * number + 2, -1).astype(np.int32)
    leaf = np.where(inner, -1, number - leaves + 1).astype(np.int32)
    roots = np.empty((2, trees, PATTERNS), dtype=np.int32)
    records = aligned((2 * trees * leaves, RECORD), np.float32)
    generator.random(out=records, dtype=np.float32)
    records[:, :LOW] *= 0.01
    records[:, LOW], records[:, HIGH] = -1.0, 1.0
    # A root with the empty place beside it, and pairs.
    size = 2 * leaves
    nodes = aligned((2 * trees * size,), NODE)
    for tree in range(2 * trees):
        kind = tree // trees
        splits = _splits(by_kind[kind], depth, generator)
        feature = np.zeros(len(number), dtype=np.int32)
        threshold = np.zeros(len(number))
        feature[inner], threshold[inner] = splits
        start = np.zeros(1, dtype=np.int32)
        part = records[tree * leaves : (tree + 1) * leaves]
        _, packed, part[:] = pack(feature, threshold, left, right, leaf, start, part)
        link = packed["link"]
        base = np.int32(tree * size)
        moved = np.where(link >= 0, link + (base << FEATURE_BITS), link - np.int32(tree * leaves))
        packed["link"] = moved
        nodes[base : base + size] = packed
        roots[kind, tree % trees] = base
    return Model("none", 0.25, "log", Forests(roots, nodes, records), {}, {})
