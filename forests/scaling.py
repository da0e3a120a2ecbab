"""Scale separation (Eq. 11-12) and the features the forests see.

Seen from a filled origin the scale is its own modulus e_i; from a void one it is the mean of all
eight cells. Features and targets are ratios to the scale, or their logarithms, so the forests are
homogeneous of degree one and need no training outside [0, 10] GPa.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dataset_gen.element import Array
from forests.ordering import cell_order

TRANSFORMS = ("log", "ratio")
"""`ratio` is the paper's; `log` takes logarithms of the features and of the target."""

LOG_FLOOR = float(np.log(1e-5))
"""Log ratios of filled cells are raised to this."""

LOG_VOID = LOG_FLOOR - 3.0
"""Log feature of a void cell: apart from every filled one, so one threshold separates them."""

FEATURES = 7

Features = NDArray[np.float32]


class Scaled(NamedTuple):
    """Blocks prepared for features, elementwise.

    filled (n, 8); scale (n, 8); value (n, 8) and reference (n, 8): moduli and scales, or their
    logarithms, so that a feature is `value / reference` or `value - reference`.
    """

    filled: NDArray[np.bool_]
    scale: Array
    value: Array
    reference: Array


def separate(young: Array, transform: str) -> Scaled:
    """Scales of blocks (n, 8), none of them all void."""
    filled = young > 0.0
    scale = np.where(filled, young, young.mean(axis=1, keepdims=True))
    if transform == "ratio":
        return Scaled(filled, scale, young, scale)
    with np.errstate(divide="ignore"):
        return Scaled(filled, scale, np.log(young), np.log(scale))


def features_of(scaled: Scaled, young: Array, transform: str) -> Features:
    """Features (n, 8 origins, 7) of e'2..e'8; the one place where they are cast to float32."""
    rows = np.arange(len(young))[:, None, None]
    value = scaled.value[rows, cell_order(young)[..., 1:]]
    if transform == "ratio":
        return np.asarray((value / scaled.reference[..., None]).astype(np.float32))
    logs = np.maximum(value - scaled.reference[..., None], LOG_FLOOR)
    return np.asarray(np.where(np.isneginf(value), LOG_VOID, logs).astype(np.float32))


def target_of(moduli: Array, scale: Array, transform: str) -> Array:
    """What a forest learns: `E / scale`, or its logarithm."""
    ratios = moduli / scale
    return np.asarray(np.log(ratios) if transform == "log" else ratios)


def modulus_of(target: Array, scale: Array, transform: str) -> Array:
    """Inverse of `target_of`."""
    return np.asarray(scale * (np.exp(target) if transform == "log" else target))
