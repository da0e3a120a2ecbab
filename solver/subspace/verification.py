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


def verify(system: System, values: Array, vectors: Array) -> tuple[Array, float]:
    """Residual ratios of the pairs, and the largest entry of X^T M X - I.

    Products are taken with the assembled matrices.
    """
    mass_vectors = system.times_mass(vectors)
    gram = system.inner(vectors, mass_vectors)
    orthogonality = float(np.abs(gram - np.eye(len(values))).max())
    return residual_ratios(system, values, vectors, mass_vectors), orthogonality


def residual_ratios(system: System, values: Array, vectors: Array, mass_vectors: Array) -> Array:
    """|K x - lambda M x| / (lambda |M x|) of each pair, in the 2-norm.

    Rigid modes, whose lambda is zero, are measured with the first elastic eigenvalue instead.
    """
    residual = system.times_stiffness(vectors) - mass_vectors * values
    norms = np.sqrt(system.column_products(residual, residual))
    mass_norms = np.sqrt(system.column_products(mass_vectors, mass_vectors))
    tiny = np.finfo(float).tiny
    return np.asarray(norms / np.maximum(residual_scale(values) * mass_norms, tiny))


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
