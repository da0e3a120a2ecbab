"""Lowest modes of one subdomain.

With overlapping interfaces the modes are those of the body that the subdomain forms with its
straddling elements in full.  Taken at the subdomain's own nodes they know how the neighbours move
with it, which free modes do not: the error of the eigenvalues falls several times at the same
number of modes.  Such a basis is that of an overlapping method (Babuska & Lipton 2011, optimal
local approximation spaces); everything else is as with free interfaces.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

from carillon.arrays import Array, Flags, Index
from carillon.fem.elements import Elements
from carillon.fem.model import RIGID_MODES
from solver.assembly.node_rows import NodeRows, Pattern
from solver.distribution.local_mesh import Cells
from solver.hcms.condense import restrict_mass, restrict_stiffness
from solver.hcms.lowest import STEPS, all_modes, lowest_modes, ritz_pairs
from solver.linear.plan import Plan

ZERO_FRACTION = 1e-10
"""Local eigenvalue, as a fraction of the ratio of the diagonals, below which it is a rigid
motion's."""


@dataclass(frozen=True)
class Region:
    """Some nodes with the cells that touch them: what modes are computed on."""

    pattern: Pattern
    plan: Plan
    lattice: Index
    """(n, 3) integer coordinates of the nodes."""
    pieces: Index | None
    """(n,) number of the piece that each node belongs to, if there are several."""

    @classmethod
    def of_cells(cls, corners: Index, lattice: Index, steps: int | None) -> Region:
        """Region of the nodes 0..n-1 at `lattice` (n, 3) among the corners of cells.

        Cells span `steps` of the lattice, see `Elements.steps`.
        """
        pattern = Pattern.of_cells(corners, 0, len(lattice), ghosts=False)
        graph = (np.ones(len(pattern.columns)), pattern.columns, pattern.indptr)
        count, label = connected_components(csr_matrix(graph, shape=(len(lattice),) * 2))
        plan = Plan(lattice, pattern.indptr, pattern.columns, steps=steps)
        return cls(pattern, plan, lattice, label if count > 1 else None)


class Subdomain:
    """A subdomain's geometry: what its modes need of the mesh, whatever the material.

    Parameters
    ----------
    start, stop
        Half-open range of the subdomain's rows.
    lattice
        (stop - start, 3) integer coordinates of its nodes.
    """

    def __init__(self, cells: Cells, start: int, stop: int, lattice: Index, treatment: str) -> None:
        self.treatment = treatment
        corners, steps = cells.corners, cells.elements.steps
        self.inside = (corners >= start) & (corners < stop)
        nodes = np.unique(corners)
        numbers = np.searchsorted(nodes, corners)
        first = int(np.searchsorted(nodes, start))
        count = stop - start
        if treatment == "overlapping":
            places = cells.elements.node_places
            around = _lattice_around(numbers, self.inside, places, first, lattice, len(nodes))
            self.region = Region.of_cells(numbers, around, steps)
            self.own = slice(3 * first, 3 * (first + count))
            self.pattern = Pattern.of_cells(corners - start, 0, count, ghosts=False)
        else:
            self.region = Region.of_cells(corners - start, lattice, steps)
            self.own = slice(0, 3 * count)
            self.pattern = self.region.pattern

    def modes(
        self, elements: Elements, keep: int, cutoff: float | None = None, steps: int = STEPS
    ) -> tuple[Array, Array]:
        """Lowest modes of the subdomain.

        Returns values (k,) [rad^2/s^2] and mass-orthonormal vectors (3 (stop - start), k), with
        which the stiffness of the subdomain by itself is diagonal.

        Parameters
        ----------
        keep
            Wanted number of modes; more come back if there are more motions without strain, all of
            which are kept, and never fewer than the six rigid ones.
        cutoff
            Eigenvalue [rad^2/s^2] up to which all modes come back, instead of `keep`.
        """
        stiffness, mass = elements.stiffness(), elements.nodal_mass()
        alone = NodeRows(self.pattern)
        alone.add(
            slice(None),
            restrict_stiffness(stiffness, self.inside, self.treatment, elements.node_places),
            restrict_mass(mass, self.inside),
        )
        size = 3 * self.pattern.stop
        count = min(max(keep, RIGID_MODES), size)
        if count == size:
            return _up_to(cutoff, *all_modes(alone, size))
        if self.treatment != "overlapping":
            return self._all_rigid(alone, count, cutoff, steps)
        body = NodeRows(self.region.pattern)
        body.add(slice(None), stiffness, mass)
        _, vectors = self._all_rigid(body, count, cutoff, steps)
        return ritz_pairs(alone, np.ascontiguousarray(vectors[self.own]))

    def _all_rigid(
        self, rows: NodeRows, count: int, cutoff: float | None, steps: int
    ) -> tuple[Array, Array]:
        """Lowest modes: `count`, or all motions without strain, or all up to the cutoff."""
        size = 3 * len(self.region.lattice)
        last = max(ZERO_FRACTION * _ratio_of_diagonals(rows), cutoff or 0.0)
        while True:
            region = self.region
            values, vectors = lowest_modes(
                rows, region.plan, region.lattice, count, region.pieces, steps
            )
            if count == size or values[-1] > last:
                return _up_to(cutoff, values, vectors)
            count = min(2 * count, size)


def _up_to(cutoff: float | None, values: Array, vectors: Array) -> tuple[Array, Array]:
    """The modes up to the cutoff, the rigid ones at least; all without one."""
    if cutoff is None:
        return values, vectors
    count = max(RIGID_MODES, int(np.searchsorted(values, cutoff, side="right")))
    return values[:count], np.ascontiguousarray(vectors[:, :count])


def _lattice_around(
    numbers: Index, inside: Flags, places: Index, first: int, lattice: Index, nodes: int
) -> Index:
    """Integer coordinates (nodes, 3) of all nodes, from those of the nodes inside.

    `places` (c, k, 3) are the coordinates of the cells' nodes about a point of each cell.
    """
    cell, corner = np.arange(len(numbers)), inside.argmax(axis=1)
    origin = lattice[numbers[cell, corner] - first] - places[cell, corner]
    corners = np.empty((nodes, 3), dtype=np.int64)
    corners[numbers] = origin[:, None, :] + places
    return corners


def _ratio_of_diagonals(rows: NodeRows) -> float:
    """Mean diagonal of K over that of M [rad^2/s^2], which is typical of the highest modes."""
    pattern = rows.pattern
    row = np.repeat(np.arange(len(pattern.indptr) - 1), np.diff(pattern.indptr))
    diagonal = pattern.columns == row
    stiff = rows.stiffness[diagonal]
    return float(np.einsum("nii->", stiff) / 3.0 / rows.mass[diagonal].sum())
