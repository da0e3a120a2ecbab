"""Evidence that eigenpairs are what they are taken for; nothing is believed of a solver."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from carillon.errors import ConvergenceError
from carillon.fem.model import RIGID_MODES

if TYPE_CHECKING:
    from solver.assembly.system import System

Array = NDArray[np.float64]

RIGID_TOLERANCE = 1e-9
"""Eigenvalues below this fraction of the largest computed one count as zero."""
ORTHOGONALITY_TOLERANCE = 1e-8
"""Largest accepted entry of X^T M X - I."""
COLUMNS_AT_ONCE = 64
"""Vectors that products are taken of together."""


def verify(system: System, values: Array, vectors: Array) -> tuple[Array, float]:
    """Residual ratios of the pairs, and the largest entry of X^T M X - I.

    Products are taken with the assembled matrices, of few columns at a time.
    """
    scale = residual_scale(values)
    ratios = np.empty(len(values))
    worst = 0.0
    for start in range(0, len(values), COLUMNS_AT_ONCE):
        few = slice(start, start + COLUMNS_AT_ONCE)
        columns = np.ascontiguousarray(vectors[:, few])
        mass_columns = system.times_mass(columns)
        gram = system.inner(vectors, mass_columns)
        gram[few] -= np.eye(gram.shape[1])
        worst = max(worst, float(np.abs(gram).max()))
        ratios[few] = residual_ratios(system, values[few], columns, mass_columns, scale[few])
    return ratios, worst


def residual_ratios(
    system: System, values: Array, vectors: Array, mass_vectors: Array, scale: Array
) -> Array:
    """|K x - lambda M x| / (scale |M x|) of each pair, in the 2-norm, see `residual_scale`."""
    residual = system.times_stiffness(vectors) - mass_vectors * values
    norms = np.sqrt(system.column_products(residual, residual))
    mass_norms = np.sqrt(system.column_products(mass_vectors, mass_vectors))
    return np.asarray(norms / np.maximum(scale * mass_norms, np.finfo(float).tiny))


def residual_scale(values: Array) -> Array:
    """What residuals are measured with: each eigenvalue, the first elastic one for rigid modes."""
    return np.maximum(values, values[RIGID_MODES])


def count_rigid(values: Array) -> int:
    """Number of eigenvalues that are zero to rounding."""
    return int(np.sum(values < RIGID_TOLERANCE * values[-1]))


def require_orthonormal(orthogonality: float) -> None:
    """Raise ConvergenceError unless the modes are mass-orthonormal to the tolerance."""
    if not orthogonality <= ORTHOGONALITY_TOLERANCE:  # nor if it is no number
        raise ConvergenceError(
            f"the modes are mass-orthonormal to {orthogonality:.1e} only, "
            f"{ORTHOGONALITY_TOLERANCE:.0e} is required"
        )


def require_six_rigid(count: int) -> None:
    """Raise ConvergenceError unless `count` is the number of a connected free body's."""
    if count != RIGID_MODES:
        raise ConvergenceError(
            f"{count} zero-frequency modes found, a connected free body has {RIGID_MODES}; part of "
            "the model hangs on a hinge or has almost no stiffness"
        )
