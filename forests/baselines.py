"""Coarsenings without training, to compare the forests with (Fig. 9)."""

from __future__ import annotations

import numpy as np

from dataset_gen.element import Array


def average(young: Array) -> Array:
    """Native coarsening (m, 8) -> (m, 8): the mean of the eight cells at every point."""
    return np.repeat(young.mean(axis=1, keepdims=True), 8, axis=1)


def galerkin(young: Array) -> Array:
    """Moduli (m, 8) with `h sum_q E_q K_q = P^T K(e) P` for blocks (m, 8), exactly.

    Along each axis a quadrature point takes 1/2 + sqrt(3)/4 from its own half and the rest from the
    other one: the weights that integrate 1 and x over either half of the element.
    """
    near = 0.5 + np.sqrt(3.0) / 4.0
    line = np.array([[near, 1.0 - near], [1.0 - near, near]])
    return np.asarray(young @ np.kron(np.kron(line, line), line))
