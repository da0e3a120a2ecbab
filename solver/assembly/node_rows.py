"""A rank's rows of K and M in 3x3 blocks of nodes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numba
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from carillon.arrays import Array, Index
from carillon.fem.elements import Elements
from solver.assembly.halo import Halo
from solver.assembly.row_products import RowProducts
from solver.distribution.node_graph import graph_of_cells

ENTRIES_AT_ONCE = 4096 * 576
"""Number of entries of element matrices that exist at once while K is assembled."""


@dataclass(frozen=True)
class Pattern:
    """Which nodes share an element, for the rows of one rank; the same for any material."""

    indptr: Index
    columns: Index
    """Compressed rows of the node graph.  Columns are this rank's nodes, counted from 0, then the
    ghosts, ascending within a row."""
    entry: NDArray[np.int32]
    """(c, k, k) entry of every pair of nodes of every cell, -1 if the row is another rank's."""
    ghosts: Index
    """(g,) distributed numbers of the columns that other ranks own, ascending."""
    start: int
    stop: int
    """Half-open range of this rank's nodes in the distributed order."""

    @classmethod
    def of_cells(cls, corners: Index, start: int, stop: int, ghosts: bool = True) -> Pattern:
        """Pattern of cells with nodes `corners` (c, k), which touch the rows [start, stop).

        Without `ghosts` the columns outside are left out as the rows are.
        """
        own = (corners >= start) & (corners < stop)
        ghosts_there = np.unique(corners[~own]) if ghosts else np.empty(0, dtype=np.int64)
        n_own = stop - start
        local = np.where(own, corners - start, n_own + np.searchsorted(ghosts_there, corners))
        width = n_own + len(ghosts_there)
        indptr, columns, entry = graph_of_cells(local, n_own, width)
        return cls(indptr, columns, entry, ghosts_there, start, stop)

    @cached_property
    def diagonal(self) -> Index:
        """Entry (rows,) of every row's own node."""
        row = np.repeat(np.arange(self.stop - self.start), np.diff(self.indptr))
        return np.flatnonzero(self.columns == row)

    @property
    def global_columns(self) -> Index:
        """Columns in the distributed order."""
        n_own = self.stop - self.start
        inside = self.columns < n_own
        result = self.columns + self.start
        result[~inside] = self.ghosts[self.columns[~inside] - n_own]
        return result


class NodeRows:
    """This rank's rows of K and M.

    Attributes
    ----------
    stiffness
        (e, 3, 3) blocks of K [N/m] along the graph.
    mass
        (e,) entries of M [kg], the same for the three components.
    """

    def __init__(
        self,
        pattern: Pattern,
        halo: Halo | None = None,
        threads: int = 1,
        mass: Array | None = None,
    ) -> None:
        """Rows of zeros; without `halo` no other rank has a part in the matrix.

        With `mass` (e,), of a solid that differs in its moduli alone, only stiffness is added.
        """
        self.pattern = pattern
        self.halo = halo
        self.threads = threads
        self.stiffness = np.zeros((len(pattern.columns), 3, 3))
        # Written in order: pages that the sums are first to touch cost several times as much.
        self.stiffness.fill(0.0)
        self._massless = mass is None
        if mass is None:
            mass = np.zeros(len(pattern.columns))
            mass.fill(0.0)
        self.mass = mass

    def add(self, cells: slice, stiffness: Array, mass: Array) -> None:
        """Add element matrices (c, 3 k, 3 k) and (c, k, k) of some of the pattern's cells."""
        _add_stiffness(self.pattern.entry[cells], stiffness, self.stiffness)
        _add_mass(self.pattern.entry[cells], mass, self.mass)

    def add_elements(self, elements: Elements) -> None:
        """Add the matrices of the pattern's cells, a few at a time."""
        count = ENTRIES_AT_ONCE // (9 * self.pattern.entry.shape[1] ** 2)
        for first in range(0, len(elements), count):
            chosen = slice(first, first + count)
            entry = self.pattern.entry[chosen]
            _add_stiffness(entry, elements.stiffness(chosen), self.stiffness)
            if self._massless:
                _add_mass(entry, elements.nodal_mass(chosen), self.mass)

    @cached_property
    def lumped_mass(self) -> Array:
        """Row sums of M (local nodes,) [kg]."""
        return np.add.reduceat(self.mass, self.pattern.indptr[:-1])

    @cached_property
    def mass_diagonal(self) -> Array:
        """Diagonal of M (local nodes,) [kg]."""
        return self.mass[self.pattern.diagonal]

    @cached_property
    def stiffness_diagonal(self) -> Array:
        """Diagonal of K (3 local nodes,) [N/m]."""
        return np.einsum("nii->ni", self.stiffness[self.pattern.diagonal]).ravel()

    def stiffness_csr(self, n_dofs: int) -> sp.csr_matrix:
        """This rank's rows of K (local unknowns, n_dofs), columns in the distributed order."""
        return self._csr_of(self.stiffness, n_dofs)

    def shifted_csr(self, shift: float, n_dofs: int) -> sp.csr_matrix:
        """This rank's rows of K - shift M (local unknowns, n_dofs), see `stiffness_csr`."""
        blocks = self.stiffness.copy()
        for component in range(3):
            blocks[:, component, component] -= shift * self.mass
        return self._csr_of(blocks, n_dofs)

    def mass_csr(self, n_dofs: int) -> sp.csr_matrix:
        """This rank's rows of M (local unknowns, n_dofs), columns in the distributed order."""
        data = (self.mass, self.pattern.global_columns, self.pattern.indptr)
        nodal = sp.csr_matrix(data, shape=(self._own, n_dofs // 3))
        return _sorted(sp.kron(nodal, sp.identity(3), format="csr"))

    def _csr_of(self, blocks: Array, n_dofs: int) -> sp.csr_matrix:
        data = (blocks, self.pattern.global_columns, self.pattern.indptr)
        return _sorted(sp.bsr_matrix(data, shape=(3 * self._own, n_dofs)).tocsr())

    @property
    def _own(self) -> int:
        return self.pattern.stop - self.pattern.start

    @cached_property
    def has_diagonal_mass(self) -> bool:
        """Whether this rank's part of M is diagonal."""
        return bool(np.count_nonzero(self.mass) == self._own)

    @cached_property
    def stiffness_products(self) -> RowProducts:
        """K, to be multiplied with blocks."""
        return self._products(self.stiffness)

    @cached_property
    def mass_products(self) -> RowProducts:
        """M, to be multiplied with blocks: the components of a node all have the same mass."""
        return self._products(self.mass[:, None, None])

    def _products(self, entries: Array) -> RowProducts:
        graph = self.pattern.indptr, self.pattern.columns
        return RowProducts(graph, entries, self.halo, self.threads)

    def times_stiffness(self, block: Array) -> Array:
        """K X for a row-major block (3 local nodes, k); collective."""
        return self.stiffness_products.times(block)

    def times_mass(self, block: Array) -> Array:
        """M X for a row-major block (3 local nodes, k); collective."""
        return self.mass_products.times(block)


def _sorted(matrix: sp.csr_matrix) -> sp.csr_matrix:
    matrix.sort_indices()
    return matrix


@numba.njit(cache=True, nogil=True)
def _add_stiffness(entry, stiffness, K):  # type: ignore[no-untyped-def]
    for cell in range(len(entry)):
        for a in range(entry.shape[1]):
            for b in range(entry.shape[1]):
                number = entry[cell, a, b]
                if number >= 0:
                    for i in range(3):
                        for j in range(3):
                            K[number, i, j] += stiffness[cell, 3 * a + i, 3 * b + j]


@numba.njit(cache=True, nogil=True)
def _add_mass(entry, mass, M):  # type: ignore[no-untyped-def]
    for cell in range(len(entry)):
        for a in range(entry.shape[1]):
            for b in range(entry.shape[1]):
                if entry[cell, a, b] >= 0:
                    M[entry[cell, a, b]] += mass[cell, a, b]
