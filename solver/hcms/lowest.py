"""Approximate lowest eigenpairs of a body that fits on one thread, by block Krylov iteration.

The modes of a subdomain only have to span a good space, so few steps from a start that is good for
smooth motions will do; Rayleigh-Ritz at the end makes them orthonormal and diagonalises.
"""

from functools import partial
from itertools import product

import numpy as np
import scipy.linalg as la
from numpy.polynomial import legendre

from carillon.arrays import Array, Index
from solver.assembly.node_rows import NodeRows
from solver.linear.multifrontal import Factor
from solver.linear.plan import Plan
from solver.subspace.orthonormal import swept, whitening
from solver.subspace.weyl import WEYL_EXPONENT

DENSE_UNKNOWNS = 200
"""Largest number of unknowns at which LAPACK finds all pairs as fast."""
DENSE_FRACTION = 0.4
"""Share of requested pairs above which LAPACK is faster."""
BLOCK_FRACTION = 0.55
"""Width of the start block as a share of the requested pairs."""
STEPS, FEWER_STEPS = 2, 1
"""Number of blocks added to the start block and its first correction: for modes that have to be
accurate by themselves, and where later steps err more."""
FIRST_SHIFT_FRACTION, SHIFT_FRACTION = 0.05, 0.3
"""Shifts as shares of the last requested eigenvalue, estimated from the start and after one
step."""
WELL_CONDITIONED = 1e-4
"""Squared share of the basis below which vectors are orthonormalised twice."""
LEAST_BLOCK = 24


def lowest_modes(
    rows: NodeRows,
    plan: Plan,
    lattice: Index,
    count: int,
    pieces: Index | None = None,
    steps: int = STEPS,
) -> tuple[Array, Array]:
    """About the lowest `count` eigenpairs of K x = lambda M x; K may be singular.

    Returns values (count,) ascending and M-orthonormal vectors (3 n, count), Ritz pairs of each
    other: the values are upper bounds, and close for all but the last ones.

    Parameters
    ----------
    rows
        All of K and M, M positive definite.
    lattice
        (n, 3) integer coordinates of the nodes.
    pieces
        (n,) number of the piece that each node belongs to, if there are several.
    steps
        Blocks added to the start block and its first correction.
    """
    size = 3 * len(lattice)
    if size <= DENSE_UNKNOWNS or count > DENSE_FRACTION * size:
        return all_modes(rows, count)
    width = max(LEAST_BLOCK, int(BLOCK_FRACTION * count))
    values, start = ritz_pairs(rows, smooth_motions(lattice, width, pieces))
    shift = FIRST_SHIFT_FRACTION * _extrapolated(values, count)
    basis = _krylov(rows, Factor(plan, rows.stiffness, rows.mass, shift), start, 1)
    # Smooth motions tell little about a material of high contrast, once corrected they do.
    values = np.linalg.eigvalsh(basis.T @ rows.times_stiffness(basis))
    shift = SHIFT_FRACTION * _extrapolated(values, count)
    factor = Factor(plan, rows.stiffness, rows.mass, shift)
    basis = _krylov(rows, factor, basis, steps, start.shape[1])
    if basis.shape[1] < count:
        return all_modes(rows, count)
    # numpy's eigh lets other threads run, scipy's does not.
    values, rotation = np.linalg.eigh(basis.T @ rows.times_stiffness(basis))
    return values[:count], basis @ np.ascontiguousarray(rotation[:, :count])


def all_modes(rows: NodeRows, count: int) -> tuple[Array, Array]:
    """The lowest `count` eigenpairs by LAPACK."""
    size = 3 * rows.pattern.stop
    K, M = rows.stiffness_csr(size).toarray(), rows.mass_csr(size).toarray()
    values, vectors = la.eigh(K, M, driver="gvd", check_finite=False)
    return values[:count], np.ascontiguousarray(vectors[:, :count])


def _krylov(
    rows: NodeRows, factor: Factor, basis: Array, steps: int, width: int | None = None
) -> Array:
    """The M-orthonormal `basis` (3 n, k) with `steps` blocks of (K - mu M)^-1 M added.

    The first comes from the last `width` vectors of the basis, each other from the one before.
    """
    block = basis if width is None else np.ascontiguousarray(basis[:, -width:])
    for _ in range(steps):
        block = factor.solve(rows.times_mass(block))
        # Twice is enough.
        _, gram = swept(block, partial(_sweep, rows, basis), rows.times_mass, 2)
        block, coefficients = _independent(rows, block, gram, basis)
        block = block @ coefficients
        basis = np.concatenate([basis, block], axis=1)
    return basis


def _sweep(rows: NodeRows, basis: Array, block: Array) -> Array:
    """Make `block` M-orthogonal to the M-orthonormal `basis`; returns what it held of it."""
    inside = basis.T @ rows.times_mass(block)
    block -= basis @ inside
    return inside


def _extrapolated(values: Array, count: int) -> float:
    """Eigenvalue number `count`, from the middle of fewer Ritz values by Weyl's law."""
    middle = len(values) // 2
    return float(values[middle] * (count / middle) ** WEYL_EXPONENT)


def ritz_pairs(rows: NodeRows, block: Array) -> tuple[Array, Array]:
    """Ritz values and M-orthonormal Ritz vectors of the span of `block` (3 n, k)."""
    block, coefficients = _independent(rows, block, block.T @ rows.times_mass(block))
    stiff = block.T @ rows.times_stiffness(block)
    reduced = coefficients.T @ stiff @ coefficients
    values, rotation = np.linalg.eigh(0.5 * (reduced + reduced.T))
    return values, block @ (coefficients @ rotation)


def _independent(
    rows: NodeRows, block: Array, gram: Array, basis: Array | None = None
) -> tuple[Array, Array]:
    """Columns that span what `block` does, and coefficients that make them orthonormal.

    What rounding has left in them of an M-orthonormal `basis` is magnified with directions that are
    few in the block, and removed again.
    """
    coefficients, kept = whitening(gram)
    if kept[0] / kept[-1] < WELL_CONDITIONED:
        # Twice is enough.
        block = block @ coefficients
        if basis is not None:
            _sweep(rows, basis, block)
        coefficients, _ = whitening(block.T @ rows.times_mass(block))
    return block, coefficients


def smooth_motions(lattice: Index, count: int, pieces: Index | None = None) -> Array:
    """Products of Legendre polynomials along the axes (3 n, count), longest wavelengths first.

    The first twelve span the affine motions, and so the rigid ones.  Where there are `pieces`, the
    affine motions of each by itself come in addition.
    """
    low = lattice.min(axis=0)
    extent = np.maximum(np.ptp(lattice, axis=0), 1).astype(float)
    functions = -(-count // 3)
    degrees = np.array(_degrees(tuple(extent.tolist()), functions))
    scaled = 2.0 * (lattice - low) / extent - 1.0
    most = int(degrees.max())
    values = [legendre.legvander(scaled[:, axis], most)[:, degrees[:, axis]] for axis in range(3)]
    fields = values[0] * values[1] * values[2]
    block = np.zeros((len(lattice), 3, functions, 3))
    for axis in range(3):
        block[:, axis, :, axis] = fields
    motions = block.reshape(3 * len(lattice), -1)[:, :count]
    if pieces is None:
        return motions
    inside = pieces[:, None] == np.arange(pieces.max() + 1)
    alone = np.repeat(inside, 3, axis=0)[:, :, None] * motions[:, None, :12]
    return np.concatenate([alone.reshape(len(motions), -1), motions[:, 12:]], axis=1)


def _degrees(extent: tuple[float, ...], count: int) -> list[tuple[int, ...]]:
    """Degrees along the axes of the `count` smoothest products, the linear ones first."""
    reach = int(np.ceil(2.0 * count ** (1.0 / 3.0) * max(extent) / np.prod(extent) ** (1.0 / 3.0)))
    # A function of higher degree than there are planes of nodes would be another one there.
    ranges = [range(min(reach, int(side)) + 1) for side in extent]
    affine = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    others = [degrees for degrees in product(*ranges) if sum(degrees) > 1]
    others.sort(key=lambda degrees: (_wave_number(degrees, extent), degrees))
    return (affine + others)[:count]


def _wave_number(degrees: tuple[int, ...], extent: tuple[float, ...]) -> float:
    return sum((degree / side) ** 2 for degree, side in zip(degrees, extent, strict=True))
