"""Coarsenings without training, to compare the forests with (Fig. 9)."""

import numpy as np

from carillon.arrays import Array
from carillon.fem.block import galerkin_moduli


def average(young: Array) -> Array:
    """Native coarsening (m, 8) -> (m, 8): the mean of the eight cells at every point."""
    return np.repeat(young.mean(axis=1, keepdims=True), 8, axis=1)


def galerkin(young: Array) -> Array:
    """Galerkin projection (m, 8) -> (m, 8), see `carillon.fem.block.galerkin_moduli`."""
    return galerkin_moduli(young)
