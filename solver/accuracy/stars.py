"""One step of conjugate gradients in a richer space, preconditioned by dense blocks about vertices.

The star of a vertex has all functions that vanish outside the cells about it: whatever warping or
bending cells lack there, and what the cells' own functions do then, is found together (additive
Schwarz method; Schoeberl, Melenk, Pechstein and Zaglmayr 2008).
"""

from pathlib import Path

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from carillon.arrays import Array, Index
from carillon.fem.finite_cells.basis import DEGREE, basis
from carillon.numerics.simd import compiler
from solver.accuracy.enriched import Enriched

compiled = compiler(Path(__file__))

SHIFT = 1e-12
"""Shift that makes a block regular, scaled to a unit diagonal."""


def gained(space: Enriched, residual: Array) -> tuple[Array, Array]:
    """Energy (k,) that a step from a residual (3 count, k) gains, and its shares (c, k) in cells.

    Shares add up to one.
    """
    step = _by_stars(space, residual)
    product = np.einsum("ik,ik->k", residual, step)
    own = space.local(step)
    energy = np.maximum(np.einsum("cik,cik->ck", own, space.stiffness @ own), 0.0)
    total = np.maximum(energy.sum(axis=0), np.finfo(float).tiny)
    return product**2 / total, energy / total


def _by_stars(space: Enriched, residual: Array) -> Array:
    """Sum of the solutions (3 count, k) of the stars alone."""
    result = np.zeros_like(residual)
    place = np.full(space.count + 1, -1)
    for cells, unknowns in _stars(space):
        place[unknowns] = np.arange(len(unknowns))
        block = np.zeros((3 * len(unknowns),) * 2)
        _assemble(space.stiffness, cells, place[space.numbers[cells]], block)
        place[unknowns] = -1
        scale = 1.0 / np.sqrt(np.maximum(np.diag(block), np.finfo(float).tiny))
        block *= scale[:, None] * scale
        block[np.diag_indices_from(block)] += SHIFT
        dofs = (3 * unknowns[:, None] + np.arange(3)).ravel()
        factor = la.cho_factor(block, lower=True, overwrite_a=True, check_finite=False)
        pushed = scale[:, None] * residual[dofs]
        result[dofs] += scale[:, None] * la.cho_solve(factor, pushed, check_finite=False)
    return result


def _stars(space: Enriched) -> list[tuple[Index, Index]]:
    """Cells about each vertex, and the numbers of nodes and functions of these alone."""
    numbers, cells = space.numbers, len(space.numbers)
    corners = space.model.cells.nodes[:, basis(DEGREE).corners].astype(np.int64)
    every = np.repeat(np.arange(cells), numbers.shape[1])
    there = numbers.ravel() < space.count
    ones = np.ones(np.count_nonzero(there))
    has = sp.csr_matrix((ones, (every[there], numbers.ravel()[there])), (cells, space.count))
    of_cells = np.asarray((has != 0).sum(axis=0)).ravel()
    vertices, vertex = np.unique(corners, return_inverse=True)
    where = vertex.ravel(), np.repeat(np.arange(cells), corners.shape[1])
    about = sp.csr_matrix((np.ones(corners.size), where), (len(vertices), cells))
    within = (about @ has).tocsr()
    stars = []
    for number in range(len(vertices)):
        own = about.indices[about.indptr[number] : about.indptr[number + 1]]
        ends = slice(within.indptr[number], within.indptr[number + 1])
        inside = within.data[ends] >= of_cells[within.indices[ends]] - 0.5
        stars.append((own.astype(np.int64), within.indices[ends][inside].astype(np.int64)))
    return stars


@compiled
def _assemble(stiffness, cells, places, block):  # type: ignore[no-untyped-def]
    """Add the entries of cells between the functions with places in a block."""
    for number in range(len(cells)):
        cell = cells[number]
        for i in range(places.shape[1]):
            row = 3 * places[number, i]
            if row < 0:
                continue
            for j in range(places.shape[1]):
                column = 3 * places[number, j]
                if column < 0:
                    continue
                for a in range(3):
                    for b in range(3):
                        block[row + a, column + b] += stiffness[cell, 3 * i + a, 3 * j + b]
