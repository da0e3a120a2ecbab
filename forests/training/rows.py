"""Rows that the trees learn from: eight of every sample, one for each origin."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dataset_gen.element import Array
from forests.scaling import FEATURES, LOG_VOID, Features, features_of, separate, target_of
from forests.training.dataset import Samples
from forests.training.structure import Rows

VOID_FEATURE = {"log": LOG_VOID, "ratio": 0.0}


def void_pattern(features: Features, transform: str) -> NDArray[np.uint8]:
    """Void cells among e'2..e'8 as bits, from features (..., 7); shape (...)."""
    void = features == np.float32(VOID_FEATURE[transform])
    return np.asarray((void << np.arange(FEATURES)).sum(axis=-1).astype(np.uint8))


def is_uniform(young: Array) -> NDArray[np.bool_]:
    """Whether all filled cells of each block (n, 8) are equal; shape (n,)."""
    return np.asarray(young.max(axis=1) == np.where(young > 0, young, np.inf).min(axis=1))


def rows_of(samples: Samples, transform: str, uniform_weight: float) -> tuple[Rows, Rows]:
    """Rows with a void and with a filled origin."""
    scaled = separate(samples.young, transform)
    features = features_of(scaled, samples.young, transform)
    pattern = void_pattern(features, transform)
    target = target_of(samples.moduli, scaled.scale, transform)
    weight = np.where(is_uniform(samples.young), uniform_weight, 1.0)
    weight = np.broadcast_to(weight[:, None], target.shape)
    void, filled = (
        Rows(features[kind], pattern[kind], target[kind], weight[kind])
        for kind in (~scaled.filled, scaled.filled)
    )
    return void, filled
