"""The assembled eigenvalue problem on distributed rows, and dense blocks of vectors over it.

Rows follow a `Decomposition`: each rank owns the unknowns of its subdomains, and holds nothing of
the others'.  A block of vectors is a row-major numpy array with this rank's rows; products and
solves take and return them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeVar, cast

import numpy as np
import scipy.sparse as sp

from carillon.arrays import Array, Index
from carillon.fem.block import degrees_of_freedom
from carillon.fem.element import rigid_motions
from carillon.fem.elements import Elements
from carillon.processes import extras
from carillon.processes.mpi import MPI
from solver.assembly import narrow
from solver.assembly.halo import Halo
from solver.assembly.node_rows import NodeRows, Pattern
from solver.distribution.collective import compute_on_root, gather_rows
from solver.distribution.local_mesh import LocalMesh

Number = TypeVar("Number", np.float64, np.int64)

# PETSc and SLEPc start on all ranks together, and one rank may come to need them alone. One
# process loads them too: all parts of a run then use, and report, one BLAS.
extras.load_cluster()

COLUMNS_GATHERED = 16
"""Number of columns that travel to rank 0 together where a block is gathered or written."""


@dataclass(frozen=True)
class Layout:
    """What the rows of a mesh have to do with each other, whatever the material."""

    local_mesh: LocalMesh
    pattern: Pattern
    halo: Halo
    """Node graph of its rows, and the exchange of rows with its neighbours."""
    coordinates: Array
    """(local nodes, 3) positions relative to the centroid, in units of the largest half extent."""
    centre: Array
    extent: float
    """(3,) centroid of the nodes, and largest half extent [m]."""
    comm: MPI.Comm

    @classmethod
    def of_local_mesh(cls, local_mesh: LocalMesh, comm: MPI.Comm = MPI.COMM_WORLD) -> Layout:
        """Layout of a local mesh; collective."""
        pattern = Pattern.of_cells(local_mesh.cells.corners, local_mesh.start, local_mesh.stop)
        starts = [local_mesh.decomposition.local_range(rank)[0] for rank in range(comm.size)]
        starts.append(local_mesh.decomposition.n_nodes)
        halo = Halo(pattern.ghosts, pattern.start, np.array(starts), comm)
        return cls(local_mesh, pattern, halo, *_centred(local_mesh, comm), comm)


@dataclass(frozen=True)
class System:
    """K u = lambda M u over the ranks of `comm`."""

    rows: NodeRows
    """This rank's rows of K [N/m] and M [kg]."""
    rigid: Array
    """(local, r) rows of the mass-orthonormal rigid motions that supports leave: all six
    of a free body."""
    mass_rigid: Array
    """(local, r) M times these."""
    coordinates: Array
    """(local nodes, 3) positions relative to the centroid, in units of the largest half extent."""
    supported: Array | None
    """(p, 3) all supports' positions likewise, those of masses aside; None of a free solid."""
    nodes: Index
    """(local nodes,) numbers of this rank's nodes in the mesh."""
    start: int
    stop: int
    """Half-open range of this rank's rows, one a node."""
    n_dofs: int
    """Number of unknowns over all ranks."""
    comm: MPI.Comm
    layout: Layout
    """Layout of rows and ranks, which all materials on its mesh share."""

    def distance_from_supports(self) -> Array | None:
        """Distance (local nodes,) from the nearest support, in half extents; None without any."""
        if self.supported is None:
            return None
        from scipy.spatial import cKDTree  # Its import takes long.

        return np.asarray(cKDTree(self.supported).query(self.coordinates)[0])

    @property
    def n_rigid(self) -> int:
        """Number of rigid motions."""
        return self.rigid.shape[1]

    def times_stiffness(self, block: Array) -> Array:
        """Product of K with a block of vectors; collective."""
        return self.rows.times_stiffness(block)

    def times_mass(self, block: Array) -> Array:
        """Product of M with a block of vectors; collective."""
        return self.rows.times_mass(block)

    def project_stiffness(self, left: Array, right: Array) -> Array:
        """left^T K right summed over the ranks; equal on all ranks, collective."""
        return self.summed(self.rows.stiffness_products.projected(left, right))

    def project_mass(self, left: Array, right: Array) -> Array:
        """left^T M right summed over the ranks; equal on all ranks, collective."""
        return self.summed(self.rows.mass_products.projected(left, right))

    @cached_property
    def K(self) -> Any:  # noqa: N802
        """Stiffness as a PETSc matrix, made when first asked for; collective."""
        return distributed_matrix(self.rows.stiffness_csr(self.n_dofs), self.comm)

    @cached_property
    def M(self) -> Any:  # noqa: N802
        """Mass as a PETSc matrix, made when first asked for; collective."""
        return distributed_matrix(self.rows.mass_csr(self.n_dofs), self.comm)

    def inner(self, left: Array, right: Array) -> Array:
        """left^T right summed over the ranks; equal on all ranks."""
        if narrow.is_narrow(left, right):
            return self.summed(narrow.inner(left, right, self.rows.threads))
        return self.summed(left.T @ right)

    def column_products(self, left: Array, right: Array) -> Array:
        """Inner product of each column of `left` with the same column of `right`."""
        return self.summed(np.einsum("ij,ij->j", left, right))

    def summed(self, local: Array) -> Array:
        """Sum over the ranks, in place."""
        if self.comm.size > 1:
            self.comm.Allreduce(MPI.IN_PLACE, local)
        return local

    def stream_to_root(
        self, block: Array, take: Callable[[Iterator[Array]], None], columns: int = COLUMNS_GATHERED
    ) -> None:
        """Give `take`, called on rank 0, the block in mesh node order, a few columns at a time.

        Every rank must call it, and raises what `take` raises.  The iterator's arrays are
        (n_dofs, c) with c = `columns` or fewer; rank 0 holds two of them at a time.
        """
        blocks = self._column_blocks(block, columns)

        def take_all() -> None:
            try:
                take(cast(Iterator[Array], blocks))
            finally:
                # The other ranks send all columns, whatever became of the first ones.
                for _ in blocks:
                    pass

        if self.comm.rank:
            for _ in blocks:
                pass
        compute_on_root(self.comm, take_all)

    def _column_blocks(self, block: Array, columns: int) -> Iterator[Array | None]:
        """Columns in mesh node order on rank 0, None elsewhere; every rank must take them all."""
        nodes = gather_rows(self.comm, self.nodes[:, None])
        dofs = None if nodes is None else degrees_of_freedom(nodes[:, 0])
        for first in range(0, block.shape[1], columns):
            local = np.ascontiguousarray(block[:, first : first + columns])
            received = gather_rows(self.comm, local)
            if received is None or dofs is None:
                yield None
            else:
                whole = np.empty_like(received)
                whole[dofs] = received
                yield whole

    def gather(self, block: Array) -> Array | None:
        """Whole block (n_dofs, k) in mesh node order on rank 0, None elsewhere.

        The one place where something of that size is on one rank: for tests and for models whose
        modes fit there.  `stream_to_root` is for the others.
        """
        whole = np.empty((self.n_dofs if self.comm.rank == 0 else 0, block.shape[1]), order="F")

        def collect(blocks: Iterator[Array]) -> None:
            first = 0
            for part in blocks:
                whole[:, first : first + part.shape[1]] = part
                first += part.shape[1]

        self.stream_to_root(block, collect)
        return whole if self.comm.rank == 0 else None

    def destroy(self) -> None:
        """Free the PETSc matrices, if there are any."""
        for name in ("K", "M"):
            matrix = self.__dict__.pop(name, None)
            if matrix is not None:
                matrix.destroy()


def assemble(
    local_mesh: LocalMesh,
    comm: MPI.Comm = MPI.COMM_WORLD,
    layout: Layout | None = None,
    elements: Elements | None = None,
    threads: int = 1,
    like: System | None = None,
) -> System:
    """Assemble stiffness and mass; every rank assembles the rows of the nodes that it owns.

    Parameters
    ----------
    elements
        Its cells with other moduli than the local mesh's.
    like
        System of the same layout with other moduli, whose mass and rigid motions it shares.
    """
    layout = Layout.of_local_mesh(local_mesh, comm) if layout is None else layout
    elements = local_mesh.cells.elements if elements is None else elements
    mass = None if like is None else like.rows.mass
    rows = NodeRows(layout.pattern, layout.halo, threads, mass)
    rows.add_elements(elements)
    if like is not None:
        return replace(like, rows=rows)
    # About the centroid of the whole body: every rank must hold rows of the same six motions.
    motions, supported = rigid_motions(layout.coordinates, np.zeros(3)), None
    if elements.attached is not None:
        supports = elements.attached.supports
        motions = motions @ supports.free_motions(layout.centre, layout.extent)
        if supports.holds.any():
            supported = (supports.positions[supports.holds] - layout.centre) / layout.extent
    motions = np.ascontiguousarray(motions)
    mass_motions = rows.times_mass(motions)
    system = System(
        rows,
        motions,
        mass_motions,
        layout.coordinates,
        supported,
        local_mesh.nodes,
        local_mesh.start,
        local_mesh.stop,
        local_mesh.n_dofs,
        comm,
        layout,
    )
    factor = np.linalg.cholesky(system.inner(motions, mass_motions))
    rigid, mass_rigid = (
        np.ascontiguousarray(np.linalg.solve(factor, each.T).T) for each in (motions, mass_motions)
    )
    return replace(system, rigid=rigid, mass_rigid=mass_rigid)


def _centred(local_mesh: LocalMesh, comm: MPI.Comm) -> tuple[Array, Array, float]:
    """Positions of this rank's nodes about the centroid, in units of the largest half extent.

    With them come the centroid (3,) and that extent [m].
    """
    total = local_mesh.positions.sum(axis=0)
    comm.Allreduce(MPI.IN_PLACE, total)
    centre = total / local_mesh.decomposition.n_nodes
    centred = local_mesh.positions - centre
    extent = np.abs(centred).max(keepdims=True)
    comm.Allreduce(MPI.IN_PLACE, extent, op=MPI.MAX)
    return np.asarray(centred / extent), centre, float(extent[0, 0])


def distributed_matrix(rows: sp.csr_matrix, comm: Any) -> Any:
    """Symmetric PETSc matrix from this rank's rows (local, n), in blocks of three unknowns."""
    from carillon.processes.petsc import PETSc

    local, total = rows.shape
    csr = (
        rows.indptr.astype(PETSc.IntType),
        rows.indices.astype(PETSc.IntType),
        rows.data.astype(PETSc.ScalarType),
    )
    matrix = PETSc.Mat().createAIJ(((local, total), (local, total)), bsize=3, csr=csr, comm=comm)
    matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    return matrix
