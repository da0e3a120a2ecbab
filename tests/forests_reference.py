"""The evaluation of forests in plain numpy, written apart from the compiled one (test support)."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from carillon.fem.element import Array
from forests.layout import FEATURE_BITS, FEATURE_MASK
from forests.model import CONSTANT, FILLED, HIGH, LOW, VOID, Model
from forests.scaling import (
    FEATURES,
    LOG_FLOOR,
    LOG_VOID,
    RATIO_CEILING,
    RATIO_FLOOR,
    Features,
    PreparedBlocks,
)

_AXES = np.array([1, 2, 4])


def _elementwise(function: np.ufunc, values: Array) -> Array:
    # numpy's own logarithms and exponentials may differ in the last bit from the C library's.
    return np.asarray(function(values), dtype=float)


_log = np.frompyfunc(lambda x: math.log(x) if x > 0.0 else 0.0, 1, 1)
_exp = np.frompyfunc(math.exp, 1, 1)


def cell_order_reference(young: Array) -> NDArray[np.int64]:
    """Cells e'1..e'8 (n, 8 origins, 8) of blocks (n, 8), see `forests.ordering`."""
    origin = np.arange(8)[:, None]
    neighbour = young[:, origin ^ _AXES]
    opposite = young[:, origin ^ 7 ^ _AXES]
    axis = np.broadcast_to(np.arange(3), neighbour.shape)
    a, b, c = np.moveaxis(_AXES[np.lexsort((axis, opposite, neighbour), axis=-1)], -1, 0)
    flips = np.stack([0 * a, a, b, c, a | b, b | c, a | c, 0 * a + 7], axis=-1)
    return np.asarray(flips ^ origin[None])


def prepare_reference(young: Array, transform: str) -> PreparedBlocks:
    """The same as `forests.scaling.prepare`, bit for bit."""
    filled = young > 0.0
    total = np.zeros(len(young))
    for column in np.sort(young, axis=1).T:
        total = total + column
    scale = np.where(filled, young, (total / 8.0)[:, None])
    rows = np.arange(len(young))[:, None, None]
    cells = cell_order_reference(young)[..., 1:]
    missing = ~filled[rows, cells]
    if transform == "log":
        values, reference = _elementwise(_log, young), _elementwise(_log, scale)
        found = np.maximum(values[rows, cells] - reference[..., None], LOG_FLOOR)
        features = np.where(missing, LOG_VOID, found)
    else:
        with np.errstate(over="ignore"):
            ratios = young[rows, cells] / scale[..., None]
        features = np.where(missing, 0.0, np.clip(ratios, RATIO_FLOOR, RATIO_CEILING))
    pattern = (missing << np.arange(FEATURES)).sum(axis=-1)
    return PreparedBlocks(features.astype(np.float32), pattern.astype(np.uint8), scale, filled)


def leaf_numbers(model: Model, young: Array) -> NDArray[np.int64]:
    """Leaves (m, 8, trees), rows of `Forests.leaves`, that the origins of blocks (m, 8) come to."""
    forests, prepared = model.forests, prepare_reference(young, model.transform)
    kind = np.where(prepared.filled, FILLED, VOID)
    node = forests.roots[kind, :, prepared.pattern].astype(np.int64)
    features = prepared.features[:, :, None]
    while ((link := forests.nodes["link"][node]) >= 0).any():
        number = np.where(link >= 0, link & FEATURE_MASK, 0)
        chosen = np.take_along_axis(features, number[..., None], axis=-1)[..., 0]
        right = chosen > forests.nodes["threshold"][node]
        node = np.where(link >= 0, (link >> FEATURE_BITS) + right, node)
    return np.asarray(~link.astype(np.int64))


def _answers(leaves: NDArray[np.float32], features: Features) -> Array:
    leaf, x = leaves.astype(float), features.astype(float)
    answer = leaf[..., CONSTANT]
    for k in range(FEATURES):
        answer = answer + leaf[..., k] * x[..., k]
    return np.asarray(np.minimum(np.maximum(answer, leaf[..., LOW]), leaf[..., HIGH]))


def coarsen_reference(model: Model, e: ArrayLike) -> Array:
    """The same as `forests.evaluate.coarsen`, bit for bit; slower, for blocks that are fit."""
    prepared = prepare_reference(np.asarray(e, dtype=float), model.transform)
    numbers = leaf_numbers(model, np.asarray(e, dtype=float))
    total = np.zeros(prepared.scale.shape)
    for tree in range(model.forests.trees):
        total = total + _answers(model.forests.leaves[numbers[..., tree]], prepared.features)
    target = total / model.forests.trees
    if model.transform == "log":
        target = _elementwise(_exp, target)
    return np.asarray(prepared.scale * target)
