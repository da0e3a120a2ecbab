"""Rows that the trees learn from: eight of every sample, one for each origin."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carillon.fem.element import Array
from forests.scaling import TRANSFORMS, Features, prepare
from forests.training.dataset import Samples
from forests.training.structure import Rows

STUDIED = ("ratio-log", "bounded")
"""Transforms that can be trained to compare them, but not evaluated: the paper's ratios r with the
logarithm of the target, and r brought to -1..1 as (r - 1) / (r + 1) with the same target."""


def is_uniform(young: Array) -> NDArray[np.bool_]:
    """Whether all filled cells of each block (n, 8) are equal; shape (n,)."""
    return np.asarray(young.max(axis=1) == np.where(young > 0, young, np.inf).min(axis=1))


def modulus_over_scale(target: Array, transform: str) -> Array:
    """Ratios E / scale from what the trees learn."""
    return target if transform == "ratio" else np.exp(target)


def _transformed(features: Features, transform: str) -> Features:
    if transform != "bounded":
        return features
    ratio = features.astype(float)
    return np.asarray(((ratio - 1.0) / (ratio + 1.0)).astype(np.float32))


def rows_of(samples: Samples, transform: str, uniform_weight: float = 1.0) -> tuple[Rows, Rows]:
    """Rows with a void and with a filled origin."""
    prepared = prepare(samples.young, transform if transform in TRANSFORMS else "ratio")
    ratios = samples.moduli / prepared.scale
    target = ratios if transform == "ratio" else np.log(ratios)
    weight = np.where(is_uniform(samples.young), uniform_weight, 1.0)
    weight = np.broadcast_to(weight[:, None], target.shape)
    void, filled = (
        Rows(
            _transformed(prepared.features[kind], transform),
            prepared.pattern[kind],
            target[kind],
            weight[kind],
        )
        for kind in (~prepared.filled, prepared.filled)
    )
    return void, filled
