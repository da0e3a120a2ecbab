"""Evidence that eigenpairs are what they are taken for; nothing is believed of a solver."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from carillon.arrays import Array
from carillon.errors import ConvergenceError
from carillon.fem.model import RIGID_MODES
from solver.subspace.rayleigh_ritz import first_elastic_estimate

if TYPE_CHECKING:
    from solver.assembly.system import System

ROUNDING = 100.0 * float(np.finfo(float).eps)
"""Share of the eigenvalue that a mode would have without cancellation of neighbours' strains, below
which an eigenvalue is zero to rounding."""
SOFT = 1e-9
"""Share of the largest computed eigenvalue below which an eigenvalue may count as zero, see
`SOFTER`."""
SOFTER = 1e-6
"""Share of the first elastic eigenvalue, as smooth displacements of the whole solid give it, below
which a soft one counts as zero. Slender solids are as soft by themselves."""
ORTHOGONALITY_TOLERANCE = 1e-8
"""Largest accepted entry of X^T M X - I."""
COLUMNS_AT_ONCE = 64
"""Number of vectors whose products are taken together."""


def verify(system: System, values: Array, vectors: Array) -> tuple[Array, float]:
    """Residual ratios of the pairs, and the largest entry of X^T M X - I.

    Products are taken with the assembled matrices, of few columns at a time.
    """
    scale = residual_scale(values, system.n_rigid)
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


def recomputed_residuals(
    K: sp.csr_matrix, M: sp.csr_matrix, values: Array, modes: Array, rigid: int = RIGID_MODES
) -> Array:
    """Residual ratios (k,) of modes (n_dofs, k) by matrices that were assembled anew."""
    mass_modes = M @ modes
    residual = K @ modes - mass_modes * values
    scale = residual_scale(values, rigid) * np.linalg.norm(mass_modes, axis=0)
    return np.asarray(np.linalg.norm(residual, axis=0) / scale)


def residual_scale(values: Array, rigid: int = RIGID_MODES) -> Array:
    """What residuals are measured with: each eigenvalue, the first elastic one for rigid modes."""
    return np.maximum(values, values[min(rigid, len(values) - 1)])


def rigid_modes(system: System, values: Array, vectors: Array) -> int:
    """Number of modes with a frequency of zero, see `count_rigid`; collective."""
    diagonal = system.rows.stiffness_diagonal[:, None]
    scales = np.full(len(values), np.inf)
    for start in range(0, len(values), COLUMNS_AT_ONCE):
        few = slice(start, start + COLUMNS_AT_ONCE)
        scales[few] = system.column_products(vectors[:, few], diagonal * vectors[:, few])
        if (values[few] > ROUNDING * scales[few]).any():
            scales[few.stop :] = 0.0
            break
    return count_rigid(values, scales, lambda: first_elastic_estimate(system))


def count_rigid(values: Array, scales: Array, estimate: Callable[[], float]) -> int:
    """Number of ascending eigenvalues (k,) that are zero: to rounding, or but for soft joints.

    Parameters
    ----------
    scales
        (k,) x^T diag(K) x of the mass-normalised modes x: a value is known to rounding of it.
    estimate
        Makes an upper bound of the first elastic eigenvalue from smooth displacements; asked for
        where motions of parts are slow beside the last mode.  They are those of a slender solid
        if the bound is as low, else of parts that hang on a hinge or on next to nothing.
    """
    zero = values <= ROUNDING * scales
    soft = ~zero & (values < SOFT * values[-1])
    if soft.any():
        try:
            zero |= soft & (values < SOFTER * estimate())
        except ConvergenceError:  # smooth displacements find a hinge, too
            zero |= soft
    return int(zero.sum())


def require_orthonormal(orthogonality: float) -> None:
    """Raise ConvergenceError unless the modes are mass-orthonormal to the tolerance."""
    if not orthogonality <= ORTHOGONALITY_TOLERANCE:  # nor if it is no number
        raise ConvergenceError(
            f"the modes are mass-orthonormal to {orthogonality:.1e} only, "
            f"{ORTHOGONALITY_TOLERANCE:.0e} is required"
        )


def require_rigid(count: int, expected: int = RIGID_MODES) -> None:
    """Raise ConvergenceError unless `count` is the `expected` number of rigid modes."""
    if count != expected:
        if expected == RIGID_MODES:
            body, springs = "a connected free body", ""
        else:
            body, springs = "the body as it is held", "springs are too soft to be told from none, "
        raise ConvergenceError(
            f"{count} zero-frequency modes found, {body} has {expected}; {springs}part of the "
            "model hangs on a hinge or has almost no stiffness"
        )
