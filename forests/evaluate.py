"""Coarse moduli of a whole mesh, and their derivatives, in one compiled pass."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray

from carillon.arrays import Array, Index
from carillon.errors import UserError
from forests.layout import FEATURE_BITS, FEATURE_MASK, prefetch
from forests.model import CONSTANT, HIGH, LOW, Model
from forests.ordering import FLIPS, order_code
from forests.scaling import (
    FEATURES,
    LARGEST_MODULUS,
    PATTERNS,
    Features,
    is_free,
    is_logarithmic,
    modulus_of,
    prepare_block,
)

MOST_BLOCKS = 1_000_000
"""Blocks that a comparison or a benchmark keeps in memory."""
STRIDE = 8
"""Features of an origin with padding, which saves a multiplication."""


@numba.njit(inline="always")
def _step(
    thresholds: NDArray[np.float32],
    links: NDArray[np.int32],
    features: Features,
    origin: int,
    node: np.uint32,
    link: np.int32,
) -> np.uint32:
    """The next node on the way of an origin; a leaf is its own."""
    feature = features[np.uint32(STRIDE * origin + (link & FEATURE_MASK))]
    right = np.int32(feature > thresholds[node, 0])
    return np.uint32((link >> FEATURE_BITS) + right) if link >= 0 else node


@numba.njit(inline="always")
def _walk(
    roots: NDArray[np.int32],
    thresholds: NDArray[np.float32],
    links: NDArray[np.int32],
    tree: int,
    features: Features,
    pattern: Index,
    numbers: Index,
) -> None:
    """Leaves `numbers[:, tree]` of the eight origins of a block.

    The eight walk in step, without a branch that depends on the data: so the processor waits for
    the memory of all of them at once and guesses wrong once a tree at most.
    """
    a = np.uint32(roots[tree, pattern[0]])
    b = np.uint32(roots[tree, pattern[1]])
    c = np.uint32(roots[tree, pattern[2]])
    d = np.uint32(roots[tree, pattern[3]])
    e = np.uint32(roots[tree, pattern[4]])
    f = np.uint32(roots[tree, pattern[5]])
    g = np.uint32(roots[tree, pattern[6]])
    h = np.uint32(roots[tree, pattern[7]])
    while True:
        to_a, to_b, to_c, to_d = links[a, 1], links[b, 1], links[c, 1], links[d, 1]
        to_e, to_f, to_g, to_h = links[e, 1], links[f, 1], links[g, 1], links[h, 1]
        if (to_a & to_b & to_c & to_d & to_e & to_f & to_g & to_h) < 0:
            break
        a = _step(thresholds, links, features, 0, a, to_a)
        b = _step(thresholds, links, features, 1, b, to_b)
        c = _step(thresholds, links, features, 2, c, to_c)
        d = _step(thresholds, links, features, 3, d, to_d)
        e = _step(thresholds, links, features, 4, e, to_e)
        f = _step(thresholds, links, features, 5, f, to_f)
        g = _step(thresholds, links, features, 6, g, to_g)
        h = _step(thresholds, links, features, 7, h, to_h)
    numbers[0, tree] = ~to_a
    numbers[1, tree] = ~to_b
    numbers[2, tree] = ~to_c
    numbers[3, tree] = ~to_d
    numbers[4, tree] = ~to_e
    numbers[5, tree] = ~to_f
    numbers[6, tree] = ~to_g
    numbers[7, tree] = ~to_h


@numba.njit(inline="always")
def _find(
    roots: NDArray[np.int32],
    thresholds: NDArray[np.float32],
    links: NDArray[np.int32],
    leaves: NDArray[np.float32],
    features: Features,
    pattern: Index,
    numbers: Index,
) -> None:
    """Leaves `numbers` (8, trees) of a block; their memory is asked for while other trees run."""
    for tree in range(len(roots)):
        _walk(roots, thresholds, links, tree, features, pattern, numbers)
        for origin in range(8):
            prefetch(leaves, numbers[origin, tree])


@numba.njit(inline="always")
def _linear(leaf: NDArray[np.float32], features: Features, origin: int) -> float:
    """Linear function of a leaf's record, not yet bounded."""
    answer = np.float64(leaf[CONSTANT])
    for k in range(FEATURES):
        answer += np.float64(leaf[k]) * np.float64(features[STRIDE * origin + k])
    return float(answer)


@numba.njit(inline="always")
def _target(leaves: NDArray[np.float32], numbers: Index, features: Features, origin: int) -> float:
    """Mean answer of the trees whose leaves are `numbers` (trees,)."""
    total = 0.0
    for tree in range(len(numbers)):
        leaf = leaves[numbers[tree]]
        answer = _linear(leaf, features, origin)
        low, high = float(leaf[LOW]), float(leaf[HIGH])
        total += min(max(answer, low), high)
    return total / len(numbers)


@numba.njit(inline="always")
def _scratch(trees: int) -> tuple[Array, Array, Array, Features, Features, Index, Index]:
    """Arrays that one block after the other is worked out in.

    Its values, scales and references (8,), features in a row and as a table (8, `STRIDE`), patterns
    (8,) and leaves (8, trees).
    """
    values, scale, references = np.empty(8), np.empty(8), np.empty(8)
    features = np.zeros(8 * STRIDE, dtype=np.float32)
    table = features.reshape(8, STRIDE)
    pattern = np.empty(8, dtype=np.int64)
    numbers = np.empty((8, trees), dtype=np.int64)
    return values, scale, references, features, table, pattern, numbers


@numba.njit(cache=True, nogil=True)
def _moduli(
    young: Array,
    logarithmic: bool,
    roots: NDArray[np.int32],
    thresholds: NDArray[np.float32],
    links: NDArray[np.int32],
    leaves: NDArray[np.float32],
    moduli: Array,
) -> None:
    """Coarse moduli (n, 8) of blocks (n, 8)."""
    values, scale, references, features, table, pattern, numbers = _scratch(len(roots))
    for block in range(len(young)):
        prepare_block(young[block], logarithmic, values, table, pattern, scale, references)
        _find(roots, thresholds, links, leaves, features, pattern, numbers)
        for origin in range(8):
            target = _target(leaves, numbers[origin], features, origin)
            moduli[block, origin] = modulus_of(target, scale[origin], logarithmic)


@numba.njit(inline="always")
def _slopes(
    leaves: NDArray[np.float32], numbers: Index, features: Features, origin: int, slopes: Array
) -> None:
    """Mean slopes (7,) of the trees' answers, zero where an answer is at its bounds."""
    slopes[:] = 0.0
    for tree in range(len(numbers)):
        leaf = leaves[numbers[tree]]
        answer = _linear(leaf, features, origin)
        if leaf[LOW] <= answer <= leaf[HIGH]:
            for k in range(FEATURES):
                slopes[k] += np.float64(leaf[k]) / len(numbers)


@numba.njit(inline="always")
def _gradient(
    young: Array,
    logarithmic: bool,
    values: Array,
    features: Features,
    pattern: int,
    scale: float,
    reference: float,
    origin: int,
    modulus: float,
    slopes: Array,
    gradient: Array,
) -> None:
    """Derivatives (8,) of the modulus of an origin by the chain rule."""
    gradient[:] = 0.0
    outer = modulus if logarithmic else scale
    through_scale = modulus / scale
    code = order_code(young, origin)
    for k in range(FEATURES):
        cell = origin ^ FLIPS[code, k]
        if pattern >> k & 1 or not is_free(values[cell], reference, logarithmic):
            continue
        share = outer * slopes[k]
        gradient[cell] += share / (young[cell] if logarithmic else scale)
        through_scale -= share * (1.0 if logarithmic else features[STRIDE * origin + k]) / scale
    if pattern >> FEATURES:
        gradient[origin] += through_scale
        return
    for cell in range(8):
        if young[cell] > 0.0:
            gradient[cell] += through_scale / 8.0


@numba.njit(cache=True, nogil=True)
def _derivatives(
    young: Array,
    logarithmic: bool,
    roots: NDArray[np.int32],
    thresholds: NDArray[np.float32],
    links: NDArray[np.int32],
    leaves: NDArray[np.float32],
    moduli: Array,
    derivatives: Array,
) -> None:
    """Coarse moduli (n, 8) of blocks (n, 8) and their derivatives (n, 8, 8)."""
    values, scale, references, features, table, pattern, numbers = _scratch(len(roots))
    slopes = np.empty(FEATURES)
    for block in range(len(young)):
        prepare_block(young[block], logarithmic, values, table, pattern, scale, references)
        _find(roots, thresholds, links, leaves, features, pattern, numbers)
        for origin in range(8):
            target = _target(leaves, numbers[origin], features, origin)
            modulus = modulus_of(target, scale[origin], logarithmic)
            moduli[block, origin] = modulus
            _slopes(leaves, numbers[origin], features, origin, slopes)
            _gradient(
                young[block],
                logarithmic,
                values,
                features,
                pattern[origin],
                scale[origin],
                references[origin],
                origin,
                modulus,
                slopes,
                derivatives[block, origin],
            )


@numba.njit(cache=True, nogil=True)
def _first_unfit(young: Array) -> tuple[int, bool]:
    """First block (8,) that has no coarse moduli, -1 if none, and whether it is void altogether."""
    for block in range(len(young)):
        largest, fit = 0.0, True
        for cell in range(8):
            fit &= 0.0 <= young[block, cell] <= LARGEST_MODULUS
            largest = max(largest, young[block, cell])
        if not fit or largest == 0.0:
            return block, fit
    return -1, True


def require_blocks(e: ArrayLike) -> Array:
    """Blocks (m, 8) as a contiguous array of float64.

    Raises UserError for a bad shape, a modulus that is negative, not finite or above
    `LARGEST_MODULUS`, or a block that is void altogether.
    """
    young = np.ascontiguousarray(e, dtype=float)
    if young.ndim != 2 or young.shape[1] != 8:
        raise UserError(f"fine moduli have shape {young.shape}, expected (blocks, 8)")
    block, fit = _first_unfit(young)
    if block < 0:
        return young
    if fit:
        raise UserError(f"block {block} is void in all eight cells: leave it out of the mesh")
    raise UserError(
        f"fine moduli of block {block} must be finite, not negative and at most "
        f"{LARGEST_MODULUS:g}: they are {', '.join(f'{each:g}' for each in young[block])}"
    )


def _run(
    kernel: Callable[..., None], model: Model, young: Array, threads: int, *results: NDArray[Any]
) -> None:
    forests = model.forests
    roots = np.ascontiguousarray(forests.roots.transpose(1, 0, 2).reshape(-1, 2 * PATTERNS))
    arrays = (roots, forests.thresholds, forests.links, forests.leaves)
    logarithmic = is_logarithmic(model.transform)
    bounds = np.linspace(0, len(young), max(1, threads) + 1).astype(int)

    def run(begin: int, end: int) -> None:
        kernel(young[begin:end], logarithmic, *arrays, *(part[begin:end] for part in results))

    if threads <= 1:
        run(0, len(young))
        return
    with ThreadPoolExecutor(threads) as pool:
        for finished in [pool.submit(run, *pair) for pair in zip(bounds[:-1], bounds[1:])]:
            finished.result()


def coarsen(model: Model, e: ArrayLike, threads: int = 1) -> Array:
    """Coarse moduli of many blocks (Eq. 12).

    Raises UserError, see `require_blocks`.

    Parameters
    ----------
    e : (m, 8)
        Fine moduli in bit order, any unit, 0 where a cell is void.
    threads
        Blocks are shared among so many threads; the result does not depend on it.

    Returns
    -------
    (m, 8)
        Positive moduli at the coarse quadrature points, in the unit of `e`.

    Examples
    --------
    >>> from forests import load_model
    >>> soft, stiff = coarsen(load_model(), [[1, 1, 1, 1, 2, 2, 2, 2], [3, 3, 3, 3, 6, 6, 6, 6]])
    >>> bool(np.allclose(stiff, 3.0 * soft))
    True
    """
    young = require_blocks(e)
    moduli = np.empty_like(young)
    _run(_moduli, model, young, threads, moduli)
    return moduli


def coarsen_with_derivatives(model: Model, e: ArrayLike, threads: int = 1) -> tuple[Array, Array]:
    """Coarse moduli E (m, 8), bit for bit those of `coarsen`, and dE_i/de_j (m, 8 i, 8 j).

    The derivative is that of the current piece: order of the cells, leaf of every tree and what is
    at its bounds stay as they are. Across their borders E jumps or bends, which no derivative
    tells. Answers at a leaf's bounds and features at theirs have slope zero, and nothing depends on
    void cells. E is homogeneous of degree one: `sum_j e_j dE_i/de_j = E_i`.

    With the transform `ratio` dE_i/de_j is constant in a piece. With `log` the elasticities
    `(e_j / E_i) dE_i/de_j` of filled origins are; those of void origins also have the part
    `(1 - sum of the slopes) e_j / (8 mean(e))` of the scale.

    Parameters and errors are those of `coarsen`.

    Examples
    --------
    >>> from forests import load_model
    >>> e = np.array([[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]])
    >>> moduli, derivatives = coarsen_with_derivatives(load_model(), e)
    >>> bool(np.allclose(derivatives[0] @ e[0], moduli[0]))
    True
    """
    young = require_blocks(e)
    moduli, derivatives = np.empty_like(young), np.empty((len(young), 8, 8))
    _run(_derivatives, model, young, threads, moduli, derivatives)
    return moduli, derivatives
