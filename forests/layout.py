"""Where the nodes of the trees stand in memory: eight bytes each, siblings side by side.

`prefetch` asks for memory before it is needed, which numba has no function for.
"""

from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numpy.typing import DTypeLike, NDArray

from carillon.arrays import Array, Index
from carillon.errors import UserError

NODE = np.dtype([("threshold", np.float32), ("link", np.int32)])
"""A node: the threshold of its split; `left child << 3 | feature`, or `~leaf` in leaves.

A row goes to the left child if its float32 feature is <= the threshold, else to the node after it.
"""
FEATURE_BITS = 3
FEATURE_MASK = 7

MOST_NODES = 1 << (31 - FEATURE_BITS)
MOST_LEAVES = MOST_NODES // 2

CLUSTER_LEVELS = 4
"""Levels of a subtree that stand together; measured best of 1 to 5."""
CACHE_LINE = 64


def rounded_down(threshold: Array) -> NDArray[np.float32]:
    """Largest float32 <= each float64: divides the float32 numbers where the float64 does."""
    with np.errstate(over="ignore"):
        near = threshold.astype(np.float32)
    return np.where(near > threshold, np.nextafter(near, np.float32(-np.inf)), near)


def aligned(shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
    """Uninitialised array that begins with a cache line."""
    size = int(np.prod(shape)) * np.dtype(dtype).itemsize
    raw = np.empty(size + CACHE_LINE, dtype=np.uint8)
    begin = -raw.ctypes.data % CACHE_LINE
    return raw[begin : begin + size].view(dtype).reshape(shape)


@numba.njit(cache=True)
def _level(
    left: NDArray[np.int32],
    right: NDArray[np.int32],
    queue: Index,
    begin: int,
    end: int,
    position: Index,
    place: int,
) -> tuple[int, int]:
    """Place the children of the nodes queue[begin:end]; they are appended to the queue."""
    last = end
    for k in range(begin, end):
        node = queue[k]
        if left[node] >= 0:
            for child in (left[node], right[node]):
                position[child] = place
                queue[last] = child
                place += 1
                last += 1
    return last, place


@numba.njit(cache=True)
def positions(
    left: NDArray[np.int32], right: NDArray[np.int32], roots: Index, levels: int
) -> Index:
    """Position (nodes,) of each node in memory, -1 for nodes that no root leads to.

    No root may stand below another. Roots come first, then pairs of siblings: clusters of `levels`
    levels, breadth first inside, depth first among each other.
    """
    position = np.full(len(left), -1, dtype=np.int64)
    position[roots] = np.arange(len(roots))
    place = len(roots) + len(roots) % 2
    queue = np.empty(len(left) + 1, dtype=np.int64)
    stack = np.empty(len(left) + 1, dtype=np.int64)
    for root in roots:
        stack[0] = root
        height = 1
        while height > 0:
            height -= 1
            queue[0] = stack[height]
            begin, end = 0, 1
            for _ in range(levels):
                last, place = _level(left, right, queue, begin, end, position, place)
                begin, end = end, last
            for k in range(end - 1, begin - 1, -1):
                if left[queue[k]] >= 0:
                    stack[height] = queue[k]
                    height += 1
    return position


def place_nodes(
    feature: NDArray[np.int32],
    threshold: Array,
    left: NDArray[np.int32],
    right: NDArray[np.int32],
    leaf: NDArray[np.int32],
    roots: NDArray[np.int32],
    levels: int = CLUSTER_LEVELS,
) -> tuple[Index, NDArray[Any]]:
    """Position (nodes,) of each node of trees, and the nodes of type `NODE` in this order.

    Raises UserError if there are too many nodes for 32 bits.

    Parameters
    ----------
    feature, threshold, left, right, leaf : (nodes,)
        As in `forests.training.structure.Tree`.
    roots : (...)
        Root nodes.
    """
    position = positions(left, right, np.unique(roots).astype(np.int64), levels)
    size = int(position.max()) + 1
    if size > MOST_NODES:
        raise UserError(f"forests of {size:,} nodes, expected {MOST_NODES:,} at most; grow fewer")
    nodes = aligned((size,), NODE)
    nodes[:] = (np.float32(0.0), np.int32(-1))
    placed = position >= 0
    inner, last = np.flatnonzero(placed & (left >= 0)), np.flatnonzero(placed & (left < 0))
    nodes["threshold"][position[inner]] = rounded_down(threshold[inner])
    nodes["link"][position[inner]] = position[left[inner]] << FEATURE_BITS | feature[inner]
    nodes["link"][position[last]] = ~leaf[last]
    return position, nodes


def pack(
    feature: NDArray[np.int32],
    threshold: Array,
    left: NDArray[np.int32],
    right: NDArray[np.int32],
    leaf: NDArray[np.int32],
    roots: NDArray[np.int32],
    records: NDArray[np.float32],
    levels: int = CLUSTER_LEVELS,
) -> tuple[NDArray[np.int32], NDArray[Any], NDArray[np.float32]]:
    """Bring trees, all in one set of arrays, and the `records` (leaves, 10) into one order.

    Returns the (...) roots, the nodes of type `NODE`, and the records in the order of the nodes.
    Raises UserError, see `place_nodes`.
    """
    position, nodes = place_nodes(feature, threshold, left, right, leaf, roots, levels)
    last = np.flatnonzero((position >= 0) & (left < 0))
    last = last[np.argsort(position[last], kind="stable")]
    nodes["link"][position[last]] = ~np.arange(len(last))
    ordered = aligned((len(last), records.shape[1]), np.float32)
    ordered[:] = records[leaf[last]]
    return position[roots].astype(np.int32), nodes, ordered


def _prefetch(context: Any, array: types.Array, index: types.Integer) -> Any:
    """Bring the beginning and the end of row `index` of a C-contiguous matrix into the cache."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        matrix = context.make_array(signature.args[0])(context, builder, arguments[0])
        byte, word = ir.IntType(8).as_pointer(), ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [byte, word, word, word])
        function = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")
        stride = builder.extract_value(matrix.strides, 0)
        first = builder.bitcast(matrix.data, byte)
        row = builder.gep(first, [builder.mul(stride, arguments[1])])
        end = builder.sub(stride, ir.Constant(stride.type, 1))
        # To read, of use again, data.
        options = [word(0), word(3), word(1)]
        for address in (row, builder.gep(row, [end])):
            builder.call(function, [address, *options])
        return context.get_dummy_value()

    return types.void(array, types.int64), generate


prefetch: Any = intrinsic(_prefetch)
