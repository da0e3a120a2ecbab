"""Rayleigh-Ritz in a block of vectors, and what it says about the first elastic eigenvalue."""

import numpy as np
import scipy.linalg as la

from carillon.arrays import Array
from carillon.errors import ConvergenceError
from solver.assembly.system import System
from solver.distribution.collective import bcast_from_root

RIGID_TOLERANCE = 1e-7
"""Share of a column's length below which its elastic part is rounding, and the column a rigid
motion."""
ELASTIC = 1e-13
"""Share of a column's length below which its rigid part is rounding."""
WELL_CONDITIONED = 1e-3
"""Least diagonal entry of the Gram matrix's Cholesky factor for which the factor is used."""
RANK_TOLERANCE = 1e-13
"""Share of the basis below which a direction is dropped as linearly dependent."""
PROBES, ORTHONORMAL = 4, 1e-10
"""Number of combinations that are tried for orthonormality, and their largest deviation from it."""
POLYNOMIAL_DEGREE = 3
"""Degree of the displacement fields that estimate the first elastic eigenvalue."""
HINGE_TOLERANCE = 1e-13
"""Estimate, as a fraction of the stiffest polynomial field's, below which it is zero to
rounding."""
ROWS_AT_ONCE = 4096
"""Number of rows of a block that lose their rigid motions together."""
SHIFT_FRACTION = 0.1
"""Shift of the singular stiffness, as a fraction of the first elastic eigenvalue's estimate."""


def rayleigh_ritz(system: System, block: Array, count: int | None = None) -> tuple[Array, Array]:
    """Ritz values and mass-orthonormal Ritz vectors of the span of `block`, rigid motions removed.

    Linearly dependent directions are dropped, so fewer than `count` pairs may come back.
    """
    block, mass_block = remove_rigid(system, np.ascontiguousarray(block))
    values, weights = ritz_pairs(system, block, system.times_stiffness(block), mass_block)
    count = len(values) if count is None else min(count, len(values))
    return values[:count], block @ weights[:, :count]


def ritz_weights(system: System, block: Array) -> tuple[Array, Array]:
    """Ritz values (k,) of the span of `block` (local, m), and their weights (m, k) in its vectors.

    The vectors lose their rigid motions, in place. No product with K or M of all of them is kept:
    this is for blocks that fill the memory, and may be columns of a wider one.
    """
    before = np.diag(system.project_mass(block, block))
    shares = system.inner(system.mass_rigid, block)
    for first in range(0, len(block), ROWS_AT_ONCE):
        here = slice(first, first + ROWS_AT_ONCE)
        block[here] -= system.rigid[here] @ shares
    gram = system.project_mass(block, block)
    elastic = np.flatnonzero(np.diag(gram) > RIGID_TOLERANCE**2 * before)
    chosen = np.ix_(elastic, elastic)
    stiff, gram = system.project_stiffness(block, block)[chosen], gram[chosen]
    # Solved once: two processors may round apart, and an eigenvector's sign hangs on rounding.
    values, of_elastic = bcast_from_root(system.comm, lambda: reduced_eigenpairs(stiff, gram))
    weights = np.zeros((block.shape[1], len(values)))
    weights[elastic] = of_elastic
    return values, weights


def ritz_pairs(
    system: System, block: Array, stiff_block: Array, mass_block: Array
) -> tuple[Array, Array]:
    """Ritz values (k,) of the span of `block` (local, m), and its weights (m, k) in the vectors.

    `stiff_block` and `mass_block` are its products with K and M.
    """
    stiff = system.inner(block, stiff_block)
    gram = None if is_orthonormal(system, block, mass_block) else system.inner(block, mass_block)
    # Solved once: two processors may round apart, and an eigenvector's sign hangs on rounding.
    return bcast_from_root(system.comm, lambda: reduced_eigenpairs(stiff, gram))


def is_orthonormal(system: System, block: Array, mass_block: Array) -> bool:
    """Whether `block` is mass-orthonormal, tried on a few of its combinations.

    The modes of a similar material are, as long as the mass is the same, and need no Gram matrix.
    """
    signs = np.random.default_rng(0).integers(0, 2, (block.shape[1], PROBES)) * 2.0 - 1.0
    difference = system.inner(mass_block, block @ signs) - signs
    return bool(np.abs(difference).max(initial=0.0) < ORTHONORMAL)


def reduced_eigenpairs(stiff: Array, gram: Array | None) -> tuple[Array, Array]:
    """Eigenpairs of the dense pencil in the numerically independent directions of `gram`.

    Without `gram` the pencil is a matrix alone.
    """
    if gram is None:
        values, weights = la.eigh(_symmetric(stiff), driver="evd", check_finite=False)
        return values, weights
    scale = 1.0 / np.sqrt(np.diag(gram))
    gram = _symmetric(gram * scale[:, None] * scale)
    stiff = _symmetric(stiff * scale[:, None] * scale)
    factor, failed = la.lapack.dpotrf(gram, lower=True)
    if not failed and np.diag(factor).min() > WELL_CONDITIONED:
        values, weights = la.eigh(stiff, gram, driver="gvd", check_finite=False)
        return values, scale[:, None] * weights
    spread, directions = la.eigh(gram, driver="evd", check_finite=False)
    independent = spread > RANK_TOLERANCE * spread[-1]
    whitening = directions[:, independent] / np.sqrt(spread[independent])
    reduced = _symmetric(whitening.T @ stiff @ whitening)
    values, rotation = la.eigh(reduced, driver="evd", check_finite=False)
    return values, scale[:, None] * (whitening @ rotation)


def remove_rigid(system: System, block: Array) -> tuple[Array, Array]:
    """Mass-orthogonal complement of `block` to the rigid motions, and its product with the mass.

    Columns that were rigid motions, of which only rounding is left, are dropped.
    """
    rigid, mass_rigid = system.rigid, system.mass_rigid
    mass_block = system.times_mass(block)
    before = system.column_products(block, mass_block)
    share = system.inner(mass_rigid, block)
    if (share**2 <= ELASTIC**2 * before).all():
        return block, mass_block
    block = block - rigid @ share
    mass_block -= mass_rigid @ share
    after = system.column_products(block, mass_block)
    elastic = after > RIGID_TOLERANCE**2 * before
    if not elastic.all():
        block, mass_block = block[:, elastic], mass_block[:, elastic]
    return np.ascontiguousarray(block), np.ascontiguousarray(mass_block)


def rigid_pairs(system: System) -> tuple[Array, Array]:
    """Rayleigh quotients (6,) and M-orthonormal vectors (local, 6) of the rigid motions.

    The quotients [rad^2/s^2] are zero but for rounding, not negative, and ascending.
    """
    stiff = system.inner(system.rigid, system.times_stiffness(system.rigid))
    values = np.maximum(np.diag(stiff), 0.0)
    order = np.argsort(values, kind="stable")
    return values[order], np.ascontiguousarray(system.rigid[:, order])


def first_elastic_estimate(system: System) -> float:
    """Upper bound [rad^2/s^2] of the first elastic eigenvalue, from polynomial displacement fields.

    It depends on the solid alone, not on a start block. Of a held solid the fields also come times
    the distance from the supports, so that some leave these alone. Raises ConvergenceError if a
    motion of a free solid other than the six rigid ones costs no energy.
    """
    degrees = range(POLYNOMIAL_DEGREE + 1)
    powers = [(a, b, c) for a in degrees for b in degrees for c in degrees]
    powers = [power for power in powers if sum(power) <= POLYNOMIAL_DEGREE]
    fields = np.stack([(system.coordinates**power).prod(axis=1) for power in powers], axis=1)
    distance = system.distance_from_supports()
    if distance is not None:
        fields = np.concatenate([fields, distance[:, None] * fields], axis=1)
    block = np.einsum("np,ij->nipj", fields, np.eye(3)).reshape(3 * len(fields), -1)
    values, _ = ritz_weights(system, np.ascontiguousarray(block))
    if distance is None and values[0] <= HINGE_TOLERANCE * values[-1]:
        raise ConvergenceError(
            "a seventh zero-frequency mode found, a connected free body has six; part of the model "
            "hangs on a hinge or has almost no stiffness"
        )
    return float(values[0])


def safe_shift(system: System) -> float:
    """Shift sigma [rad^2/s^2]: K + sigma M is definite, inverse iteration hardly slower."""
    return SHIFT_FRACTION * first_elastic_estimate(system)


def _symmetric(matrix: Array) -> Array:
    return np.asarray(0.5 * (matrix + matrix.T))
