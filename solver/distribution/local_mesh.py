"""Each rank's part of the solid, scattered once by rank 0, which alone reads and cuts the mesh."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Flags, Index
from carillon.fem.elements import Chosen, Elements
from carillon.fem.model import Solid
from carillon.fem.regions import Regions
from carillon.processes.mpi import MPI
from solver.distribution.collective import AnyArray, bcast_from_root, receive_arrays, send_arrays
from solver.distribution.decomposition import Decomposition, decompose, decompose_by_planes
from solver.distribution.planes import lattice_of

_LOCAL_MESH, _MODULI = 10, 12


@dataclass(frozen=True)
class Cells:
    """Some cells of the mesh with their material.

    `corners` (c, k) are the rows of their nodes, see `Decomposition`.
    """

    corners: Index
    elements: Elements

    def __len__(self) -> int:
        return len(self.corners)

    def take(self, chosen: Chosen) -> Cells:
        """The chosen cells."""
        elements = self.elements.of(*(values[chosen] for values in self.elements.arrays()))
        return Cells(self.corners[chosen], elements)

    def join(self, others: Cells) -> Cells:
        """These cells, then the others."""
        pairs = zip(self.arrays(), others.arrays(), strict=True)
        return self.from_arrays([np.concatenate(pair) for pair in pairs])

    def inside(self, start: int, stop: int) -> Flags:
        """Whether each node (c, k) is one of the rows [start, stop)."""
        return (self.corners >= start) & (self.corners < stop)

    def arrays(self) -> list[AnyArray]:
        """What differs from cell to cell, for a message; the inverse of `from_arrays`."""
        return [self.corners, *self.elements.arrays()]

    def from_arrays(self, arrays: list[AnyArray]) -> Cells:
        """Cells of the same solid from the arrays of a message."""
        corners, *elements = arrays
        return Cells(corners, self.elements.of(*elements))


@dataclass(frozen=True)
class LocalMesh:
    """What one rank knows of the solid."""

    decomposition: Decomposition
    """Subdomains and owners, the same on every rank."""
    start: int
    stop: int
    """Half-open range of this rank's rows."""
    cells: Cells
    """The cells that touch them, by ascending number."""
    nodes: Index
    """(stop - start,) numbers of this rank's nodes in the mesh."""
    positions: Array
    """(stop - start, 3) their positions [m]."""
    numbers: Index
    """(c,) numbers of `cells` in the mesh."""
    origin: Array
    """(3,) position of lattice coordinate (0, 0, 0) [m]."""

    @property
    def n_dofs(self) -> int:
        """Number of unknowns of the whole solid."""
        return 3 * self.decomposition.n_nodes

    def lattice(self) -> Index:
        """Integer coordinates (stop - start, 3) of this rank's nodes, in `Elements.edge`."""
        return lattice_of(self.positions, self.origin, self.cells.elements.edge)

    def cells_by_subdomain(self, parts: range) -> dict[int, Index]:
        """Positions in `cells` of those that touch each subdomain in `parts`, ascending."""
        corner_part = np.searchsorted(self.decomposition.offsets, self.cells.corners, side="right")
        part, cell = _incidences(corner_part - 1)
        ends = np.searchsorted(part, [*parts, parts.stop])
        return {part: cell[ends[i] : ends[i + 1]] for i, part in enumerate(parts)}


def distribute(
    model: Solid | None,
    subdomains: int | None = None,
    seed: int = 0,
    comm: MPI.Comm = MPI.COMM_WORLD,
    by_planes: bool = False,
) -> LocalMesh:
    """Cut the solid on rank 0 and give every rank its part.

    Raises UserError on every rank, if there are more subdomains than cells or more ranks than
    subdomains.

    Parameters
    ----------
    model
        The solid; only rank 0's is looked at, the others may pass None.
    subdomains
        Number of subdomains; from the number of unknowns if not given.
    by_planes
        Whether each rank has one subdomain, cut by planes: the fastest to eliminate.
    """
    order = np.empty(0, dtype=np.int64)

    def cut() -> tuple[Decomposition, Elements, Array]:
        nonlocal order
        assert model is not None
        if by_planes:
            decomposition, order = decompose_by_planes(model, comm.size)
        else:
            decomposition, order = decompose(model, subdomains, seed, comm.size)
        nothing = model.elements.of(*(values[:0] for values in model.elements.arrays()))
        return decomposition, nothing, model.mesh.origin

    decomposition, constants, origin = bcast_from_root(comm, cut)
    if comm.rank == 0:
        assert model is not None
        nodes, positions, numbers, cells = _scatter(model, decomposition, order, comm)
    else:
        nodes, positions, numbers, *arrays = receive_arrays(comm, 0, _LOCAL_MESH)
        cells = Cells(np.empty((0, 0), dtype=np.int64), constants).from_arrays(arrays)
    start, stop = decomposition.local_range(comm.rank)
    return LocalMesh(decomposition, start, stop, cells, nodes, positions, numbers, origin)


def scatter_moduli(local_mesh: LocalMesh, young: Array | None, comm: MPI.Comm) -> LocalMesh:
    """A rank's part of the solid with other moduli.

    `young` (c, p) are the moduli [Pa] of all elements, see `Solid.element_moduli`, on rank 0.
    """
    everyone = comm.gather(local_mesh.numbers)
    if comm.rank == 0:
        assert young is not None and everyone is not None
        sent = [
            send_arrays(comm, [young[everyone[rank]]], rank, _MODULI)
            for rank in range(1, comm.size)
        ]
        mine = young[local_mesh.numbers]
        for message in sent:
            message.wait()
    else:
        (mine,) = receive_arrays(comm, 0, _MODULI)
    cells = replace(local_mesh.cells, elements=local_mesh.cells.elements.with_young(mine))
    return replace(local_mesh, cells=cells)


def with_regions(local_mesh: LocalMesh, regions: Regions) -> LocalMesh:
    """A rank's part of the solid of other materials."""
    cells = replace(local_mesh.cells, elements=local_mesh.cells.elements.with_regions(regions))
    return replace(local_mesh, cells=cells)


def _scatter(
    model: Solid, decomposition: Decomposition, order: Index, comm: MPI.Comm
) -> tuple[Index, Array, Index, Cells]:
    """Send every rank its nodes, their positions, its cells' numbers and cells; return rank 0's."""
    row = np.empty(len(order), dtype=np.int64)
    row[order] = np.arange(len(order))
    corners = row[model.connectivity]
    whole = Cells(corners, model.elements)
    ends = [decomposition.local_range(rank)[1] for rank in range(comm.size)]
    rank_of, cell = _incidences(np.searchsorted(ends, corners, side="right"))
    first = np.searchsorted(rank_of, np.arange(comm.size + 1))

    def part(rank: int) -> tuple[Index, Array, Index, Cells]:
        start, stop = decomposition.local_range(rank)
        nodes = order[start:stop].copy()
        numbers = cell[first[rank] : first[rank + 1]].copy()
        return nodes, model.positions[nodes], numbers, whole.take(numbers)

    sent = []
    for rank in range(1, comm.size):
        *arrays, cells = part(rank)
        sent.append(send_arrays(comm, [*arrays, *cells.arrays()], rank, _LOCAL_MESH))
    own = part(0)
    for message in sent:
        message.wait()
    return own


def _incidences(corner_owner: NDArray[np.integer]) -> tuple[Index, Index]:
    """Pairs (owner, cell) from the owner (c, k) of each node, each once, sorted."""
    count = max(len(corner_owner), 1)
    cell = np.arange(len(corner_owner), dtype=np.int64)[:, None]
    owner, cells = np.divmod(np.unique(corner_owner.astype(np.int64) * count + cell), count)
    return owner, cells
