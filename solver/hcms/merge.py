"""Joining two groups of subdomains by a reduced eigenproblem (Eq. 13-15).

With modes V1, V2 of the two groups and the interface matrices dK, dM that joining them adds,

    K' = [D1 + V1^T dK11 V1, V1^T dK12 V2; ., D2 + V2^T dK22 V2],  M' = [I, V1^T dM12 V2; ., I],

where only rows of V1 and V2 at nodes of straddling cells matter.  The diagonal blocks need one
group alone, so each is formed where the group lies.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from carillon.arrays import Array, Index
from carillon.fem.block import degrees_of_freedom
from carillon.fem.model import RIGID_MODES
from solver.assembly.sparse import assemble_elements
from solver.distribution.collective import AnyArray
from solver.distribution.local_mesh import Cells
from solver.hcms.condense import restrict_stiffness
from solver.hcms.counts import Tally, eigen_flops, sparse_product_flops
from solver.hcms.distributed_products import Crew

ZERO_FRACTION = 1e-10
"""A reduced eigenvalue below this fraction of the largest is a rigid motion's."""


@dataclass
class Group:
    """What a merge needs to know of a group of subdomains."""

    start: int
    stop: int
    """Half-open range of the group's rows (one a node)."""
    values: Array
    """(k,) eigenvalues of the kept modes [rad^2/s^2]."""
    boundary: Index
    """(b,) ascending rows that share a cell with a node outside the group."""
    modes: Array
    """(3 b, k) the kept modes there."""
    cells: Cells
    """The cells with corners both inside and outside the group."""

    def modes_at(self, rows: Index) -> Array:
        """The kept modes (3 len(rows), k) at some rows of the boundary."""
        if len(rows) == len(self.boundary):
            return self.modes
        return self.modes[degrees_of_freedom(np.searchsorted(self.boundary, rows))]

    def arrays(self) -> list[AnyArray]:
        """All arrays, for a message; the inverse of `group_from_arrays`."""
        return [self.values, self.boundary, self.modes, *self.cells.arrays()]


def group_from_arrays(arrays: list[AnyArray], start: int, stop: int, like: Cells) -> Group:
    """Group from the arrays of a message; `like` are other cells of the same solid."""
    values, boundary, modes, *cells = arrays
    return Group(start, stop, values, boundary, modes, like.from_arrays(cells))


def boundary_of(cells: Cells, start: int, stop: int) -> tuple[Index, Cells]:
    """Rows of [start, stop) with a neighbour outside, and the cells in which they have it.

    `cells` are at least those that straddle the boundary, each once.
    """
    inside = cells.inside(start, stop)
    crossing = inside.any(axis=1) & ~inside.all(axis=1)
    cells = cells.take(crossing)
    return np.unique(cells.corners[inside[crossing]]), cells


@dataclass
class Interface:
    """The matrices that joining two groups adds, on the nodes of the cells that straddle both.

    The stiffness is K(left + right) - K(left) - K(right), each restricted to its own nodes, and the
    mass is the coupling that the two groups' masses leave out.
    """

    left: Index
    right: Index
    """Ascending rows of the left and of the right group in these cells."""
    stiffness: sp.csr_matrix
    mass: sp.csr_matrix
    """On the unknowns of `left`, then those of `right`."""

    def blocks(self, matrix: sp.csr_matrix) -> tuple[sp.csr_matrix, sp.csr_matrix, sp.csr_matrix]:
        """Blocks 11, 22 and 21 of either matrix, the last with rows of the right group."""
        split = 3 * len(self.left)
        return matrix[:split, :split], matrix[split:, split:], matrix[split:, :split]

    @property
    def mass_across(self) -> sp.csr_matrix:
        """Block 21 of the mass, which alone is not zero but for symmetry."""
        return self.blocks(self.mass)[2]


def interface(cells: Cells, start: int, middle: int, stop: int, treatment: str) -> Interface:
    """Interface between the groups of rows [start, middle) and [middle, stop).

    Either group's boundary cells will do for `cells`: those that touch both are in both sets.
    """
    left, right = cells.inside(start, middle), cells.inside(middle, stop)
    straddling = np.flatnonzero(left.any(axis=1) & right.any(axis=1))
    # No two cells have the same corners and key: the sums do not depend on where they are made.
    order = np.lexsort((cells.elements.sort_key[straddling], *cells.corners[straddling].T[::-1]))
    straddling = straddling[order]
    left, right, cells = left[straddling], right[straddling], cells.take(straddling)
    element, places = cells.elements.stiffness(), cells.elements.node_places
    stiffness = (
        restrict_stiffness(element, left | right, treatment, places)
        - restrict_stiffness(element, left, treatment, places)
        - restrict_stiffness(element, right, treatment, places)
    )
    across = left[:, :, None] & right[:, None, :]
    mass = cells.elements.nodal_mass() * (across | across.transpose(0, 2, 1))
    rows = np.unique(cells.corners[left | right])
    # Matrices of outside corners are zero, so any row may stand for them.
    position = np.where(left | right, np.searchsorted(rows, cells.corners), 0)
    K, M = assemble_elements(position, stiffness, mass, len(rows))
    K.eliminate_zeros()
    M.eliminate_zeros()
    count = int(np.searchsorted(rows, middle))
    return Interface(rows[:count], rows[count:], K, M)


def project(terms: Sequence[tuple[Array, sp.csr_matrix, Array]], crew: Crew) -> list[Array]:
    """modes^T matrix others of each term, for sparse matrices; the crew shares dense products."""
    factors = []
    for modes, matrix, others in terms:
        crew.tally.flops += sparse_product_flops(matrix.nnz, others.shape[1])
        if matrix.nnz:
            factors.append((modes, np.asarray(matrix @ others)))
    products = iter(crew.transposed_products(factors))
    return [
        next(products) if matrix.nnz else np.zeros((modes.shape[1], others.shape[1]))
        for modes, matrix, others in terms
    ]


class Reduced(NamedTuple):
    """Lower triangles of the reduced pencil K', M' (k1 + k2, k1 + k2); M' is None if it is I."""

    stiffness: Array
    mass: Array | None


def reduced_pencil(
    left: Array, right: Array, stiffness: Sequence[Array], mass_across: Array
) -> Reduced:
    """Pencil of the joined groups in the space of their kept modes.

    Parameters
    ----------
    left, right
        Eigenvalues (k1,) and (k2,) of either group.
    stiffness
        V1^T dK11 V1 (k1, k1), V2^T dK22 V2 (k2, k2) and V2^T dK21 V1 (k2, k1).
    mass_across
        V2^T dM21 V1 (k2, k1).
    """
    split = len(left)
    size = split + len(right)
    K = np.zeros((size, size), order="F")
    K[:split, :split], K[split:, split:], K[split:, :split] = stiffness
    K[np.diag_indices(size)] += np.concatenate([left, right])
    if not mass_across.any():
        return Reduced(K, None)
    M = np.zeros((size, size), order="F")
    M[split:, :split] = mass_across
    M[np.diag_indices(size)] = 1.0
    return Reduced(K, M)


def all_pairs(reduced: Reduced, tally: Tally) -> tuple[Array, Array]:
    """All eigenvalues (n,) and vectors (n, n) of the reduced pencil, which is overwritten."""
    K, M = reduced
    tally.flops += eigen_flops(len(K), M is not None)
    values, vectors = la.eigh(
        K,
        M,
        driver="evd" if M is None else "gvd",
        overwrite_a=True,
        overwrite_b=True,
        check_finite=False,
    )
    return values, vectors


def number_kept(values: Array, keep: int, cutoff: float | None = None) -> int:
    """How many of all `values` (n,) a group keeps: `keep`, or more if more of them are zero.

    With a `cutoff`, those up to it instead of `keep`.
    """
    zeros = int(np.searchsorted(values, ZERO_FRACTION * values[-1]))
    if cutoff is not None:
        keep = max(RIGID_MODES, int(np.searchsorted(values, cutoff, side="right")))
    return min(max(keep, zeros), len(values))


def join(left: Group, right: Group, values: Array, Q: Array, crew: Crew) -> Group:
    """The joined group, given the eigenpairs of its reduced pencil."""
    split = len(left.values)
    # Cells that touch both groups and a third are in both sets.
    third = right.cells.take(~right.cells.inside(left.start, left.stop).any(axis=1))
    boundary, cells = boundary_of(left.cells.join(third), left.start, right.stop)
    count = int(np.searchsorted(boundary, left.stop))
    modes = np.empty((3 * len(boundary), Q.shape[1]))
    modes[: 3 * count], modes[3 * count :] = crew.products(
        [
            (left.modes_at(boundary[:count]), np.ascontiguousarray(Q[:split])),
            (right.modes_at(boundary[count:]), np.ascontiguousarray(Q[split:])),
        ]
    )
    return Group(left.start, right.stop, values, boundary, modes, cells)
