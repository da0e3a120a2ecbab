"""Coarse moduli of a whole mesh at once: compiled, and in plain numpy as its reference."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numba
import numpy as np
from numpy.typing import ArrayLike

from carillon.errors import UserError
from dataset_gen.element import Array
from forests.model import Forests, Model
from forests.scaling import (
    FEATURES,
    LOG_FLOOR,
    LOG_VOID,
    Features,
    Scaled,
    features_of,
    modulus_of,
    separate,
)


@numba.njit(cache=True, nogil=True, inline="always")
def _order(young: Array, origin: int, cells: np.ndarray) -> None:
    """Cells e'2..e'8 seen from `origin`; the rule is that of `forests.ordering`."""
    a, b, c = 1, 2, 4
    if _after(young, origin, a, b):
        a, b = b, a
    if _after(young, origin, b, c):
        b, c = c, b
    if _after(young, origin, a, b):
        a, b = b, a
    cells[0], cells[1], cells[2] = origin ^ a, origin ^ b, origin ^ c
    cells[3], cells[4], cells[5] = origin ^ a ^ b, origin ^ b ^ c, origin ^ a ^ c
    cells[6] = origin ^ 7


@numba.njit(cache=True, nogil=True, inline="always")
def _after(young: Array, origin: int, a: int, b: int) -> bool:
    """Whether axis a, the earlier one, comes after axis b."""
    one, two = young[origin ^ a], young[origin ^ b]
    if one != two:
        return bool(one > two)
    one, two = young[origin ^ 7 ^ a], young[origin ^ 7 ^ b]
    if one != two:
        return bool(one > two)
    return a > b


@numba.njit(cache=True, nogil=True)
def _evaluate(
    young: Array,
    value: Array,
    reference: Array,
    logarithmic: bool,
    roots: np.ndarray,
    feature: np.ndarray,
    threshold: np.ndarray,
    left: np.ndarray,
    right: np.ndarray,
    leaf: np.ndarray,
    coefficients: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    target: Array,
) -> None:
    """Mean answer of the trees for each origin of each block, written to `target` (n, 8)."""
    cells = np.empty(FEATURES, dtype=np.int64)
    x = np.empty(FEATURES, dtype=np.float32)
    trees = roots.shape[1]
    for block in range(len(young)):
        for origin in range(8):
            _order(young[block], origin, cells)
            for k in range(FEATURES):
                near = value[block, cells[k]]
                if not logarithmic:
                    x[k] = near / reference[block, origin]
                elif near == -np.inf:
                    x[k] = LOG_VOID
                else:
                    x[k] = max(near - reference[block, origin], LOG_FLOOR)
            forest = 1 if young[block, origin] > 0.0 else 0
            total = 0.0
            for tree in range(trees):
                node = roots[forest, tree]
                while left[node] >= 0:
                    node = left[node] if x[feature[node]] <= threshold[node] else right[node]
                number = leaf[node]
                answer = np.float64(coefficients[number, FEATURES])
                for k in range(FEATURES):
                    answer += np.float64(coefficients[number, k]) * np.float64(x[k])
                bottom, top = np.float64(low[number]), np.float64(high[number])
                total += float(min(max(answer, bottom), top))
            target[block, origin] = total / trees


def _require_blocks(e: ArrayLike) -> Array:
    young = np.ascontiguousarray(e, dtype=float)
    if young.ndim != 2 or young.shape[1] != 8:
        raise UserError(f"fine moduli have shape {young.shape}, expected (blocks, 8)")
    if not np.isfinite(young).all() or (young < 0.0).any():
        raise UserError("fine moduli must be finite and not negative")
    empty = np.flatnonzero(~young.any(axis=1))
    if len(empty):
        raise UserError(f"block {empty[0]} is void in all eight cells: leave it out of the mesh")
    return young


def coarsen(model: Model, e: ArrayLike, threads: int = 1) -> Array:
    """Coarse moduli of many blocks (Eq. 12).

    Parameters
    ----------
    e : (m, 8) fine moduli in bit order, any unit, 0 where a cell is void.
    threads : blocks are shared among so many threads; the result does not depend on it.

    Returns
    -------
    (m, 8) positive moduli at the coarse quadrature points, in the unit of `e`.

    Raises
    ------
    UserError
        For a bad shape, a negative or non-finite modulus, or a block that is void altogether.
    """
    young = _require_blocks(e)
    scaled = separate(young, model.transform)
    target = np.empty_like(young)
    forests = model.forests
    bounds = np.linspace(0, len(young), max(1, threads) + 1).astype(int)

    def run(part: slice) -> None:
        _evaluate(
            young[part],
            scaled.value[part],
            scaled.reference[part],
            model.transform == "log",
            forests.roots,
            forests.feature,
            forests.threshold,
            forests.left,
            forests.right,
            forests.leaf,
            forests.coefficients,
            forests.low,
            forests.high,
            target[part],
        )

    parts = [slice(*pair) for pair in zip(bounds[:-1], bounds[1:], strict=True)]
    if len(parts) == 1:
        run(parts[0])
    else:
        with ThreadPoolExecutor(len(parts)) as pool:
            list(pool.map(run, parts))
    return modulus_of(target, scaled.scale, model.transform)


def coarsen_reference(model: Model, e: ArrayLike) -> Array:
    """The same as `coarsen` in plain numpy, bit for bit; slower, for checks."""
    young = _require_blocks(e)
    scaled = separate(young, model.transform)
    features = features_of(scaled, young, model.transform)
    target = _reference_target(model.forests, features, scaled)
    return modulus_of(target, scaled.scale, model.transform)


def _reference_target(forests: Forests, features: Features, scaled: Scaled) -> Array:
    total = np.zeros(scaled.scale.shape)
    trees = forests.roots.shape[1]
    for tree in range(trees):
        node = forests.roots[scaled.filled.astype(int), tree]
        while (inner := forests.left[node] >= 0).any():
            chosen = np.take_along_axis(features, forests.feature[node][..., None], axis=-1)[..., 0]
            below = np.where(
                chosen <= forests.threshold[node], forests.left[node], forests.right[node]
            )
            node = np.where(inner, below, node)
        number = forests.leaf[node]
        coefficients = forests.coefficients[number].astype(float)
        answer = coefficients[..., FEATURES]
        for k in range(FEATURES):
            answer = answer + coefficients[..., k] * features[..., k].astype(float)
        bottom, top = forests.low[number].astype(float), forests.high[number].astype(float)
        total = total + np.minimum(np.maximum(answer, bottom), top)
    return total / trees
