"""Scale separation (Eq. 11-12) and the features the forests see.

Seen from a filled origin the scale is its own modulus e_i; from a void one it is the mean of all
eight cells. Features and targets are ratios to the scale, or their logarithms, so the forests are
homogeneous of degree one and need no training outside [0, 10] GPa.

What holds for one block is compiled in place wherever it is needed: in the evaluation of a mesh and
in `prepare`, which makes the rows to train on.
"""

import math
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Flags, Index
from carillon.errors import UserError
from forests.ordering import FLIPS, order_code

TRANSFORMS = ("log", "ratio")
"""`ratio` is the paper's; `log` takes logarithms of the features and of the target."""
LOG_FLOOR = float(np.log(1e-5))
"""Log ratios of filled cells are raised to this."""
LOG_VOID = LOG_FLOOR - 3.0
"""Log feature of a void cell: apart from every filled one, so one threshold separates them."""
RATIO_FLOOR = float(np.finfo(np.float32).tiny)
RATIO_CEILING = float(np.finfo(np.float32).max)
"""Bounds of the ratios of filled cells: none becomes 0, as those of void cells, or infinite."""
FEATURES = 7

PATTERNS = 1 << FEATURES
"""Void patterns of the seven other cells, seen from an origin: bit k is set if e'(k+2) is void."""
LARGEST_MODULUS = 1e300
"""Largest modulus of a cell in any unit; sums of eight of them are still finite."""

Features = NDArray[np.float32]


class PreparedBlocks(NamedTuple):
    """Blocks as the forests see them."""

    features: Features
    """(n, 8 origins, 7) float32: of e'2..e'8."""
    pattern: NDArray[np.uint8]
    """(n, 8) uint8: see `PATTERNS`."""
    scale: Array
    """(n, 8) in the unit of the moduli."""
    filled: Flags
    """(n, 8) bool: whether the origin is filled."""


@numba.njit(inline="always")
def void_cells(young: Array) -> int:
    """Void cells of a block (8,) as bits."""
    void = 0
    for cell in range(8):
        void |= int(young[cell] == 0.0) << cell
    return void


@numba.njit(inline="always")
def mean_modulus(young: Array, ordered: Array) -> float:
    """Mean of a block (8,), the same in all its orientations: summed in ascending order.

    `ordered` (8,) is overwritten.
    """
    for cell in range(8):
        ordered[cell] = young[cell]
    for step in range(8):
        for cell in range(step & 1, 7, 2):
            one, two = ordered[cell], ordered[cell + 1]
            ordered[cell], ordered[cell + 1] = min(one, two), max(one, two)
    total = 0.0
    for cell in range(8):
        total += ordered[cell]
    return total / 8.0


@numba.njit(inline="always")
def value_of(modulus: float, logarithmic: bool) -> float:
    """What features compare of a modulus or a scale: itself or its logarithm, 0 for a void cell."""
    return math.log(modulus) if logarithmic and modulus > 0.0 else modulus


@numba.njit(inline="always")
def feature_of(value: float, reference: float, logarithmic: bool) -> float:
    """Feature of a filled cell from its value and that of the scale, before it is rounded."""
    if logarithmic:
        return max(value - reference, LOG_FLOOR)
    return min(max(value / reference, RATIO_FLOOR), RATIO_CEILING)


@numba.njit(inline="always")
def is_free(value: float, reference: float, logarithmic: bool) -> bool:
    """Whether the feature of a filled cell is not held by its bounds."""
    if logarithmic:
        return value - reference > LOG_FLOOR
    return RATIO_FLOOR < value / reference < RATIO_CEILING


@numba.njit(inline="always")
def prepare_block(
    young: Array,
    logarithmic: bool,
    values: Array,
    features: Features,
    pattern: Index,
    scale: Array,
    references: Array,
) -> None:
    """Prepare one block (8,), not void altogether.

    Writes the cells' values (8,), features (8, >= 7), patterns (8,) with bit 7 set where the origin
    is filled, scales (8,) and their values, the references (8,). Here alone features are rounded
    to float32.
    """
    void = void_cells(young)
    mean, mean_value = 0.0, 0.0
    if void:
        mean = mean_modulus(young, scale)
        mean_value = value_of(mean, logarithmic)
    void_feature = LOG_VOID if logarithmic else 0.0
    for cell in range(8):
        values[cell] = value_of(young[cell], logarithmic)
    for origin in range(8):
        empty = void >> origin & 1
        scale[origin] = mean if empty else young[origin]
        reference = mean_value if empty else values[origin]
        references[origin] = reference
        code = order_code(young, origin)
        bits = (1 - empty) << FEATURES
        for k in range(FEATURES):
            cell = origin ^ FLIPS[code, k]
            missing = void >> cell & 1
            feature = feature_of(values[cell], reference, logarithmic)
            features[origin, k] = np.float32(void_feature if missing else feature)
            bits |= missing << k
        pattern[origin] = bits


@numba.njit(cache=True, nogil=True)
def _prepare(
    young: Array,
    logarithmic: bool,
    features: Features,
    pattern: NDArray[np.uint8],
    scale: Array,
    filled: Flags,
) -> None:
    values, references = np.empty(8), np.empty(8)
    bits = np.empty(8, dtype=np.int64)
    for block in range(len(young)):
        prepare_block(
            young[block], logarithmic, values, features[block], bits, scale[block], references
        )
        for origin in range(8):
            pattern[block, origin] = bits[origin] & (PATTERNS - 1)
            filled[block, origin] = bits[origin] >> FEATURES == 1


def is_logarithmic(transform: str) -> bool:
    """Whether features and target are logarithms.

    Raises UserError for a transform that is not one of `TRANSFORMS`.
    """
    if transform not in TRANSFORMS:
        raise UserError(f"transform {transform!r} is unknown, choose {' or '.join(TRANSFORMS)}")
    return transform == "log"


def prepare(young: Array, transform: str) -> PreparedBlocks:
    """Prepare blocks (n, 8), none of them all void, as the evaluation of a mesh does."""
    young = np.ascontiguousarray(young, dtype=float)
    shape = young.shape
    prepared = PreparedBlocks(
        np.empty((*shape, FEATURES), dtype=np.float32),
        np.empty(shape, dtype=np.uint8),
        np.empty(shape),
        np.empty(shape, dtype=np.bool_),
    )
    _prepare(young, is_logarithmic(transform), *prepared)
    return prepared


@numba.njit(inline="always")
def modulus_of(target: float, scale: float, logarithmic: bool) -> float:
    """Modulus of an origin from what the trees answer: `E / scale`, or its logarithm."""
    return scale * (math.exp(target) if logarithmic else target)
