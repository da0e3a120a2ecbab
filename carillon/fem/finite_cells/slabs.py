"""Regions of what voxels hold where that is thin.

A wall that is thin in a voxel lies between the places at which regions are looked for there, and
lines that run along it miss it. What the voxel holds of it is taken as the straight body that has
its volume, middle and second moments, and is divided where regions meet in that.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from carillon.arrays import Array, Flags, Index
from carillon.fem.finite_cells.cells import FiniteCells, middles_of_portions
from carillon.fem.finite_cells.region_lines import Boxes, LocalPieces

LEAST = 1e-14
"""Share of a body's variance that is added along all axes, so that none vanishes."""
AT_ONCE = 2048
"""Pieces of lines that are integrated at once: 25 MB."""


@dataclass(frozen=True)
class Slabs(Boxes):
    """Portions of voxels in which the solid is thin, each as a straight body of its moments."""

    bodies: tuple[Array, Array]
    """Middles and edges of all portions, see `straight_bodies`."""
    groups = 1

    @cached_property
    def is_cut(self) -> Flags:
        """Nothing of a slab is outside the solid."""
        return np.zeros(len(self.portion), dtype=bool)

    @cached_property
    def frames(self) -> tuple[Array, Array]:
        middle, edges = (each[self.portion] for each in self.bodies)
        return middle - 0.5 * edges.sum(axis=2), edges

    def integrals(self, pieces: LocalPieces, group: Index, count: int) -> Array:
        cells = self.cells
        nodes, shares = np.polynomial.legendre.leggauss(cells.basis.degree + 1)
        cell = cells.cell[self.portion]
        corner, edge = cells.origin + cells.step * cells.corner[cell], cells.edges[cell]
        length = pieces.high - pieces.low
        share = cells.shares[self.portion][pieces.box] * pieces.share * length
        summed = np.zeros((count, cells.basis.n_points))
        for first in range(0, len(group), AT_ONCE):
            # Pieces of lines, each with all of its points.
            few = np.repeat(np.arange(first, min(first + AT_ONCE, len(group))), len(nodes))
            along = np.tile((nodes + 1.0) / 2.0, len(few) // len(nodes))
            along = pieces.low[few] + length[few] * along
            weight = share[few] * np.tile(shares / 2.0, len(few) // len(nodes))
            box = pieces.box[few]
            place = self.points(box, pieces.axis[few], along, pieces.across[few])
            values = cells.basis.polynomials((place - corner[box]) / edge[box, None])
            rows = group[few], np.arange(len(few))
            summed += sp.csr_matrix((weight, rows), (count, len(few))) @ values
        return summed


def straight_bodies(cells: FiniteCells) -> tuple[Array, Array]:
    """Middles (e, 3) and edges (e, 3, 3) [m], in columns, of bodies with portions' moments."""
    middle, covariances = middles_of_portions(cells)
    thinnest = np.linalg.eigh(covariances)[1][:, :, 0]
    # Two edges stay in planes of the lattice: a wall right across a voxel is such a body.
    order = (np.abs(thinnest).argmax(axis=1)[:, None] + np.arange(1, 4)) % 3
    rows = np.arange(len(order))[:, None, None]
    turned = covariances[rows, order[:, :, None], order[:, None]]
    least = LEAST * np.einsum("eii->e", turned)
    halves = np.linalg.cholesky(turned + least[:, None, None] * np.eye(3))
    edges = np.empty_like(halves)
    np.put_along_axis(edges, np.repeat(order[:, :, None], 3, axis=2), halves, axis=1)
    return middle, np.sqrt(12.0) * edges
