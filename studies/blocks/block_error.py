"""Expected displacement error of one coarse element in the place of a 2x2x2 block (section 8.1).

The block has fine edge 1 and is free all round; K is the stiffness of its active nodes, those that
touch a filled cell (all 27 of a solid block). N are orthonormal motions without strain: the six
rigid ones and, where cells hang together at edges or corners only, the mechanisms; they depend on
the void pattern alone. Forces f are drawn at random, self-equilibrated (N^T f = 0). Then

- the fine displacements are u = K^+ f, without any part in N;
- the coarse element takes the loads P^T f, where P interpolates trilinearly from its corners to the
  active nodes; its displacements are P Z K_c^-1 Z^T P^T f, with the straining motions Z (24, 18)
  of the corners and K_c (18, 18) its stiffness in them. Their part in N is removed by the
  orthogonal projection Q = I - N N^T.

So u_c - u = (Y K_c^-1 Y^T - K^+) f with Y = Q P Z, linear in f. For f = W g with independent
standard normal g the expectation over all forces needs no sample:

    E |u_c - u|^2 = |(Y K_c^-1 Y^T - K^+) W|_F^2,        E |u|^2 = |K^+ W|_F^2.

The loads are

nodal
    Independent normal forces on all components of all active nodes, projected: W = Q.
inertial
    Inertia M P Z of normal mixtures of the straining motions, balanced by the inertia of motions
    without strain: W = (I - M N (N^T M N)^-1 N^T) M P Z with the consistent mass M of filled cells.
corner
    Normal forces Z g on the corners alone; displacements are compared at the corners, in the
    straining motions: |K_c^-1 - F|_F^2 over |F|_F^2, F = Z^T C K^+ C^T Z, where C reads the
    corners' displacements off the active nodes. A void corner has none; it continues the trilinear
    motion nearest to the active nodes.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np

from carillon.arrays import Array, Index
from carillon.fem.block import void_patterns
from carillon.processes.threads import blas_threads
from dataset_gen.objectives.chen2015 import corner_selection
from dataset_gen.objectives.patterns import corner_strains, pattern_of, straining_motions

LOADS = ("nodal", "inertial", "corner")
"""Load cases."""

AT_ONCE = 500
"""Blocks whose flexibility matrices are in memory together."""


@dataclass(frozen=True)
class ErrorTables:
    """What a void pattern decides; r = active degrees of freedom less motions without strain."""

    stiffness: Array
    """(8, r * r) flattened K_j of the cells on the complement of N, zero for void ones."""
    basis: Array
    """(r, 18) orthonormal basis V of the coarse element's displacements Y = V R."""
    inertia: Array
    corners: Array
    """(r, 18) inertial loads W and corner forces C^T Z."""
    loads: dict[str, tuple[Array, Array]]
    """Matrices (18, 18) and (18, m) by load case: the coarse element answers `left @ K_c^-1 @
    right`."""


class FineResponse(NamedTuple):
    """Fine answers of n blocks to one load case."""

    target: Array
    """(n, 18, m) part that a coarse element can answer."""
    rest: Array
    """(n,) square of what it cannot."""
    total: Array
    """(n,) square of both."""


class Errors(NamedTuple):
    """Mean squares of each block by load case, (n,) each."""

    squared: dict[str, Array]
    """E|u_c - u|^2."""
    minimum: dict[str, Array]
    """What it cannot fall below, whatever the element: the part of u that no motion of the corners
    gives; 0 for loads on the corners."""
    reference: dict[str, Array]
    """E|u|^2."""

    def relative(self, load: str) -> Array:
        """E|u_c - u|^2 / E|u|^2 of each block."""
        return np.asarray(self.squared[load] / self.reference[load])

    def relative_minimum(self, load: str) -> Array:
        """Least possible error relative to E|u|^2 of each block."""
        return np.asarray(self.minimum[load] / self.reference[load])


@cache
@blas_threads(1)
def tables_of(mask: int, poisson: float) -> ErrorTables:
    """Tables of the pattern whose filled cells are the set bits of `mask` (1..255)."""
    pattern, motions = pattern_of(mask, poisson), straining_motions()
    size, nulls = pattern.null.shape
    complement = np.linalg.qr(pattern.null, mode="complete")[0][:, nulls:]
    stiffness = np.zeros((8, (size - nulls) ** 2))
    for cell, matrix in zip(pattern.cells, pattern.stiffness):
        stiffness[cell] = (complement.T @ matrix.reshape(size, size) @ complement).ravel()
    basis, factor = np.linalg.qr(complement.T @ pattern.interpolation @ motions)
    load = pattern.mass @ pattern.interpolation @ motions
    moved = pattern.mass @ pattern.null
    balance = moved @ np.linalg.solve(pattern.null.T @ moved, pattern.null.T @ load)
    inertia: Array = np.asarray(complement.T @ (load - balance), dtype=np.float64)
    corners = complement.T @ corner_selection(mask, poisson).T @ motions
    unit = np.eye(motions.shape[1])
    loads = {
        "nodal": (factor, factor.T),
        "inertial": (factor, factor.T @ basis.T @ inertia),
        "corner": (unit, unit),
    }
    return ErrorTables(stiffness, basis, inertia, corners, loads)


def _square(matrices: Array) -> Array:
    return np.asarray(np.einsum("nij,nij->n", matrices, matrices))


def fine_responses(young: Array, mask: int, poisson: float) -> dict[str, FineResponse]:
    """Answers of blocks (n, 8) that share one void pattern, by load case."""
    tables = tables_of(mask, poisson)
    size = len(tables.basis)
    flexibility = np.linalg.inv((young @ tables.stiffness).reshape(-1, size, size))

    def response(answer: Array) -> FineResponse:
        target = tables.basis.T @ answer
        total = _square(answer)
        return FineResponse(target, np.maximum(total - _square(target), 0.0), total)

    nodal = _square(flexibility)
    answered = tables.basis.T @ flexibility @ tables.basis
    corner = tables.corners.T @ flexibility @ tables.corners
    return {
        "nodal": FineResponse(answered, np.maximum(nodal - _square(answered), 0.0), nodal),
        "inertial": response(flexibility @ tables.inertia),
        "corner": FineResponse(corner, np.zeros(len(young)), _square(corner)),
    }


@cache
@blas_threads(1)
def _quadrature_forms(poisson: float) -> Array:
    """Z^T K_q Z (8, 18 * 18) of the coarse element of edge 2, flattened."""
    strains = (corner_strains(poisson) @ straining_motions()).reshape(8, 6, -1)
    return np.asarray((strains.transpose(0, 2, 1) @ strains).reshape(8, -1))


def coarse_flexibility(moduli: Array, poisson: float) -> Array:
    """K_c^-1 (n, 18, 18) of coarse elements (n, 8) in the straining motions of their corners."""
    matrices = (moduli @ _quadrature_forms(poisson)).reshape(len(moduli), 18, 18)
    return np.asarray(np.linalg.inv(matrices))


def pattern_rows(young: Array, at_most: int) -> Iterator[tuple[int, Index]]:
    """Void patterns of blocks (n, 8) and the rows of each, up to `at_most` together."""
    masks = void_patterns(young)
    for mask in np.unique(masks):
        rows = np.flatnonzero(masks == mask)
        for first in range(0, len(rows), at_most):
            yield int(mask), rows[first : first + at_most]


@blas_threads(1)
def pattern_errors(
    young: Array, coarse: Sequence[Array], mask: int, poisson: float
) -> list[Errors]:
    """Errors of several coarsenings of blocks (n, 8) that share one void pattern.

    `coarse`: for each coarsening either its moduli (n, 8) or the flexibility (n, 18, 18) of its
    elements in the straining motions.
    """
    loads = tables_of(mask, poisson).loads
    fine = fine_responses(young, mask, poisson)
    minimum = {name: fine[name].rest for name in LOADS}
    reference = {name: fine[name].total for name in LOADS}
    errors = []
    for answer in coarse:
        flexibility = coarse_flexibility(answer, poisson) if answer.ndim == 2 else answer
        squared = {}
        for name in LOADS:
            left, right = loads[name]
            error = left @ flexibility @ right - fine[name].target
            squared[name] = _square(error) + fine[name].rest
        errors.append(Errors(squared, minimum, reference))
    return errors


def displacement_errors(young: Array, coarse: Sequence[Array], poisson: float) -> list[Errors]:
    """Errors of several coarsenings of any blocks (n, 8); see `pattern_errors`.

    Squared displacements are for forces of unit variance, in the unit of 1 / (modulus x edge).
    """
    count = len(young)

    def empty() -> dict[str, Array]:
        return {name: np.empty(count) for name in LOADS}

    errors = [Errors(empty(), empty(), empty()) for _ in coarse]
    for mask, rows in pattern_rows(young, AT_ONCE):
        parts = pattern_errors(young[rows], [part[rows] for part in coarse], mask, poisson)
        for whole, part in zip(errors, parts):
            for into, values in zip(whole, part):
                for name in LOADS:
                    into[name][rows] = values[name]
    return errors
