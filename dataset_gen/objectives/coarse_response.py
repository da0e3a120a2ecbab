"""How the coarse element answers nodal forces, and how that changes with log E.

`V B V^T` is its flexibility on the active nodes, with V a basis of what nodal forces feel of the 18
straining motions, orthonormal on the active nodes, and `B(E) = (sum_q E_q S_q^T S_q)^-1`.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_triangular

from carillon.arrays import Array
from carillon.numerics.simd import LANES, empty, load, root, spread, store
from carillon.processes.threads import blas_threads
from dataset_gen.objectives.compiled import compiled
from dataset_gen.objectives.descent import CURVATURE, GRADIENT, HESSIAN, VALUE
from dataset_gen.objectives.elimination import Sum, elimination_of, lower_tiles_of, sum_of
from dataset_gen.objectives.free_block import FreeBlock, free_block_of
from dataset_gen.objectives.kernel import (
    DENSE,
    LOWER,
    MOTIONS,
    STRAINS,
    WEIGHTS,
    add_diagonal,
    assemble,
    factorise,
    multiply,
    solve_lower,
    solve_upper,
)
from dataset_gen.objectives.patterns import corner_strains, pattern_of, straining_motions


class Coarse(NamedTuple):
    """Coarse element of a void pattern."""

    block: FreeBlock
    basis: Array
    """flat (a, 18): v on the active nodes in the order of elimination."""
    stiffness: Sum
    """The lower tiles of sum_q E_q S_q^T S_q."""
    strains: Array
    """flat (18, 48): all S_q^T."""


class CoarseResponse(NamedTuple):
    """Answer of the coarse elements in the lanes."""

    weights: Array
    """(9) moduli E."""
    factor: Array
    """Lower tiles of L with B^-1 = L L^T."""
    flexibility: Array
    """(18, 18) B."""
    scaled: Array
    """(18, 48) L^-1 S_q^T sqrt(E_q)."""
    strained: Array
    """(18, 48) b S_q^T sqrt(E_q); the derivative of B in log E_q is -R_q^T R_q with R_q^T columns 6
    q to 6 q + 5."""


@cache
@blas_threads(1)
def coarse_of(mask: int, poisson: float) -> Coarse:
    """Tables of the pattern whose filled cells are the set bits of `mask` (1..255)."""
    pattern, motions = pattern_of(mask, poisson), straining_motions()
    felt = pattern.without_null(pattern.interpolation @ motions)
    lower = np.linalg.cholesky(felt.T @ felt)
    basis = solve_triangular(lower, felt.T, lower=True).T
    strains = solve_triangular(lower, (corner_strains(poisson) @ motions).T, lower=True)
    parts = strains.reshape(MOTIONS, 8, 6).swapaxes(0, 1)
    nodes = MOTIONS // 3
    tiles = lower_tiles_of(parts @ parts.swapaxes(1, 2), np.ones((nodes, nodes), dtype=bool))
    order = pattern.positions(elimination_of(mask).dofs)
    return Coarse(
        block=free_block_of(mask, poisson),
        basis=basis[order].ravel(),
        stiffness=sum_of(range(8), tiles),
        strains=strains.ravel(),
    )


@compiled
def empty_response() -> CoarseResponse:
    """Room for an answer."""
    return CoarseResponse(
        empty(WEIGHTS),
        empty(LOWER),
        empty(MOTIONS**2),
        empty(MOTIONS * STRAINS),
        empty(MOTIONS * STRAINS),
    )


@compiled
def respond(coarse: Coarse, logs: Array, response: CoarseResponse) -> None:
    """Answer of elements with moduli exp(`logs`), (8)."""
    weights, factor, flexibility, scaled, strained = response
    for q in range(8):
        for lane in range(LANES):
            weights[q, lane] = np.exp(logs[q, lane])
    assemble(coarse.stiffness, weights, factor)
    factorise(DENSE, factor)
    for n in range(MOTIONS**2):
        store(flexibility, n, spread(0.0))
    add_diagonal(flexibility, MOTIONS, spread(1.0))
    solve_lower(DENSE, factor, flexibility, MOTIONS)
    solve_upper(DENSE, factor, flexibility, MOTIONS)
    for q in range(8):
        size = root(load(weights, q))
        for field in range(MOTIONS):
            for n in range(STRAINS * field + 6 * q, STRAINS * field + 6 * q + 6):
                store(scaled, n, load(coarse.strains, n) * size)
    solve_lower(DENSE, factor, scaled, STRAINS)
    for n in range(MOTIONS * STRAINS):
        store(strained, n, load(scaled, n))
    solve_upper(DENSE, factor, strained, STRAINS)


@compiled
def write_derivatives(response: CoarseResponse, gram: Array, slope: Array, out: Array) -> None:
    """Write value, gradient and Hessian in log E of an objective that is a square in B.

    `gram` (9, 9) are the products of its derivatives by -log E_q, and in the last row of its root.
    With M = `slope` (18, 18) the objective's derivative in B, the second derivatives of B add
    `2 <R_p M R_q^T, Y_p Y_q^T>`, Y_q^T being columns of `scaled`, and on the diagonal the gradient.
    """
    store(out, VALUE, load(gram, 80))
    for p in range(8):
        store(out, GRADIENT + p, spread(-2.0) * load(gram, 72 + p))
        for q in range(p + 1):
            store(out, HESSIAN + 8 * p + q, spread(2.0) * load(gram, 9 * p + q))
    bent, forces, strains = empty(MOTIONS * STRAINS), empty(6 * STRAINS), empty(6 * STRAINS)
    strained, scaled = response.strained, response.scaled
    multiply(bent, (slope, 0, MOTIONS, 1), (strained, 0, 1, STRAINS), MOTIONS, STRAINS, MOTIONS)
    for p in range(8):
        width = 6 * p + 6
        rows = (strained, 6 * p, 1, STRAINS)
        multiply(forces, rows, (bent, 0, 1, STRAINS), 6, width, MOTIONS)
        rows = (scaled, 6 * p, 1, STRAINS)
        multiply(strains, rows, (scaled, 0, 1, STRAINS), 6, width, MOTIONS)
        for q in range(p + 1):
            even, odd = spread(0.0), spread(0.0)
            for i in range(0, 6 * width, width):
                for n in range(i + 6 * q, i + 6 * q + 6, 2):
                    even = even + load(forces, n) * load(strains, n)
                    odd = odd + load(forces, n + 1) * load(strains, n + 1)
            store(out, CURVATURE + 8 * p + q, spread(2.0) * (even + odd))
        at = CURVATURE + 9 * p
        store(out, at, load(out, at) + load(out, GRADIENT + p))
