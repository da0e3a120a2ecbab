"""Moduli that reproduce the energies of given motions: the step all linear objectives share."""

from collections.abc import Callable
from typing import NamedTuple, Protocol, TypeVar

import numpy as np

from carillon.arrays import Array, Flags
from dataset_gen.objectives.bounded import minimise_above
from dataset_gen.objectives.flops import count

RIDGE = 1e-3
"""Pull towards E0, as a share of the mean diagonal of the normal matrix."""
REFERENCE_FLOOR = 1e-2
"""E0 is at least this share of the block's largest fine modulus."""
MODULUS_FLOOR = 1e-2
"""Lower bound of every coarse modulus, as a share of the block's largest fine modulus."""


class PatternTables(Protocol):
    """What an objective knows of a void pattern."""

    def flops(self) -> int:
        """Floating-point operations of one block's normal equations."""


T = TypeVar("T", bound=PatternTables)


class PatternFits(NamedTuple):
    """Coarse moduli (n, 8), relative residuals (n,) and convergence flags (n,) of one pattern."""

    moduli: Array
    residual: Array
    converged: Flags


class NormalEquations(NamedTuple):
    """`E^T matrix E - 2 vector^T E + constant`, one row per block: (n, 8, 8), (n, 8), (n,)."""

    matrix: Array
    vector: Array
    constant: Array


def form_equations(
    kernel: Callable[[T, Array, NormalEquations], None], tables: T, young: Array
) -> NormalEquations:
    """Normal equations of blocks (n, 8) by a compiled `kernel` and the tables of their pattern."""
    rows = len(young)
    equations = NormalEquations(np.empty((rows, 8, 8)), np.empty((rows, 8)), np.empty(rows))
    kernel(tables, np.ascontiguousarray(young), equations)
    count(rows * tables.flops())
    return equations


def reference_moduli(young: Array) -> Array:
    """E0 (n, 8): the fine moduli, raised to `REFERENCE_FLOOR` of the block's largest."""
    return np.maximum(young, REFERENCE_FLOOR * young.max(axis=1, keepdims=True))


def bounded_moduli(
    equations: NormalEquations, young: Array, reference: Array, ridge: float = RIDGE
) -> PatternFits:
    """Minimise the quadratic plus `ridge` towards `reference`, subject to the modulus floor."""
    matrix, vector, constant = equations
    weight = ridge * np.einsum("nii->n", matrix) / 8.0
    damped = matrix + weight[:, None, None] * np.eye(8)
    target = vector + weight[:, None] * reference
    lower = MODULUS_FLOOR * young.max(axis=1)
    moduli, settled = minimise_above(damped, target, lower)
    left = np.einsum("ni,nij,nj->n", moduli, matrix, moduli) - 2.0 * (vector * moduli).sum(axis=1)
    residual = np.sqrt(np.maximum(left + constant, 0.0) / constant)
    return PatternFits(moduli, residual, settled)
