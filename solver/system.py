"""The assembled eigenvalue problem on distributed rows, and dense blocks of vectors over it.

Rows follow a `Decomposition`: each rank owns the unknowns of its subdomains, and holds nothing of
the others'.  A block of vectors is a Fortran-ordered numpy array with this rank's rows; products
and solves take and return them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, TypeVar, cast

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from dataset_gen.block import degrees_of_freedom
from dataset_gen.element import rigid_motions
from solver.decomposition import keep_on_root
from solver.distribution import Share
from solver.eigensolver import distributed_matrix, factor_package
from solver.sparse import assemble_elements

Array = NDArray[np.float64]
Number = TypeVar("Number", np.float64, np.int64)

COLUMNS_GATHERED = 16
"""Columns that travel to rank 0 together where a block of vectors is gathered or written."""


@dataclass(frozen=True)
class System:
    """K u = lambda M u over the ranks of `comm`.

    Attributes
    ----------
    K, M
        PETSc matrices [N/m], [kg].
    rigid
        (local, 6) this rank's rows of the mass-orthonormal rigid motions.
    coordinates
        (local nodes, 3) positions relative to the centroid, in units of the largest half extent.
    nodes
        (local nodes,) numbers of this rank's nodes in the mesh.
    start, stop
        Half-open range of this rank's rows, one a node.
    n_dofs
        Number of unknowns over all ranks.
    """

    K: Any
    M: Any
    rigid: Array
    coordinates: Array
    nodes: NDArray[np.int64]
    start: int
    stop: int
    n_dofs: int
    comm: MPI.Comm

    def multiply(self, matrix: Any, block: Array) -> Array:
        """Product of a PETSc matrix with a block of vectors."""
        dense = _wrap(block, self.n_dofs, self.comm)
        product = matrix.matMult(dense)
        result = np.array(product.getDenseArray(readonly=True), order="F")
        product.destroy()
        dense.destroy()
        return result

    def inner(self, left: Array, right: Array) -> Array:
        """left^T right summed over the ranks; equal on all ranks."""
        return self._summed(left.T @ right)

    def column_products(self, left: Array, right: Array) -> Array:
        """Inner product of each column of `left` with the same column of `right`."""
        return self._summed(np.einsum("ij,ij->j", left, right))

    def _summed(self, local: Array) -> Array:
        """Sum over the ranks, in place."""
        if self.comm.size > 1:
            self.comm.Allreduce(MPI.IN_PLACE, local)
        return local

    def local_rows(self, block: Array) -> Array:
        """This rank's rows of a replicated block (n_dofs, k) given in mesh node order."""
        return np.asfortranarray(block[degrees_of_freedom(self.nodes)])

    def pour(
        self,
        block: Array,
        take: Callable[[Iterator[Array]], None],
        columns: int = COLUMNS_GATHERED,
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
        keep_on_root(self.comm, take_all)

    def _column_blocks(self, block: Array, columns: int) -> Iterator[Array | None]:
        """Columns in mesh node order on rank 0, None elsewhere; every rank must take them all."""
        nodes = self._gathered(self.nodes[:, None], 1)
        dofs = None if nodes is None else degrees_of_freedom(nodes[:, 0])
        for first in range(0, block.shape[1], columns):
            local = np.ascontiguousarray(block[:, first : first + columns])
            received = self._gathered(local, 3)
            if received is None or dofs is None:
                yield None
            else:
                whole = np.empty_like(received)
                whole[dofs] = received
                yield whole

    def gather(self, block: Array) -> Array | None:
        """Whole block (n_dofs, k) in mesh node order on rank 0, None elsewhere.

        The one place where something of that size is on one rank: for tests and for models whose
        modes fit there.  `pour` is for the others.
        """
        whole = np.empty((self.n_dofs if self.comm.rank == 0 else 0, block.shape[1]), order="F")

        def collect(blocks: Iterator[Array]) -> None:
            first = 0
            for part in blocks:
                whole[:, first : first + part.shape[1]] = part
                first += part.shape[1]

        self.pour(block, collect)
        return whole if self.comm.rank == 0 else None

    def _gathered(self, local: NDArray[Number], per_node: int) -> NDArray[Number] | None:
        """Rows of all ranks on rank 0, of an array (per_node * local nodes, c)."""
        columns = local.shape[1]
        counts = self.comm.gather(local.size)
        if self.comm.rank:
            self.comm.Gatherv(local, None)
            return None
        whole = np.empty((per_node * self.n_dofs // 3, columns), dtype=local.dtype)
        self.comm.Gatherv(local, (whole, counts))
        return whole

    def destroy(self) -> None:
        """Free the PETSc matrices."""
        self.K.destroy()
        self.M.destroy()


def assemble(share: Share, comm: MPI.Comm = MPI.COMM_WORLD) -> System:
    """Assemble stiffness and mass; every rank assembles the rows of the nodes that it owns."""
    cells = share.cells
    K_rows, M_rows = assemble_elements(
        cells.corners,
        cells.elements.stiffness(),
        cells.elements.nodal_mass(),
        share.stop - share.start,
        share.n_dofs // 3,
        share.start,
    )
    K = distributed_matrix(K_rows, comm)
    M = distributed_matrix(M_rows, comm)
    coordinates = _centred(share, comm)
    # About the centroid of the whole body: every rank must hold rows of the same six motions.
    motions = np.asfortranarray(rigid_motions(coordinates, np.zeros(3)))
    system = System(
        K, M, motions, coordinates, share.nodes, share.start, share.stop, share.n_dofs, comm
    )
    gram = system.inner(motions, system.multiply(M, motions))
    rigid = np.asfortranarray(np.linalg.solve(np.linalg.cholesky(gram), motions.T).T)
    return replace(system, rigid=rigid)


def _centred(share: Share, comm: MPI.Comm) -> Array:
    """Positions of this rank's nodes about the centroid, in units of the largest half extent."""
    total = share.positions.sum(axis=0)
    comm.Allreduce(MPI.IN_PLACE, total)
    centred = share.positions - total / share.decomposition.n_nodes
    extent = np.abs(centred).max(keepdims=True)
    comm.Allreduce(MPI.IN_PLACE, extent, op=MPI.MAX)
    return np.asarray(centred / extent)


class ShiftedInverse:
    """Solves (K + shift M) X = B for blocks of right-hand sides by sparse Cholesky."""

    def __init__(self, system: System, shift: float) -> None:
        if shift <= 0.0:
            raise ValueError("a free body has a singular stiffness; the shift must be positive")
        self._system = system
        self.shift = shift
        self._matrix = system.K.copy()
        self._matrix.axpy(shift, system.M, structure=PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
        self._matrix.setOption(PETSc.Mat.Option.SPD, True)
        self._pc = PETSc.PC().create(system.comm)
        self._pc.setOperators(self._matrix)
        self._pc.setType(PETSc.PC.Type.CHOLESKY)
        self._pc.setFactorSolverType(factor_package(system.comm.size))
        self._pc.setUp()
        self._factor = self._pc.getFactorMatrix()

    def solve(self, block: Array) -> Array:
        """Solution for a block of right-hand sides (local, k)."""
        solution = np.zeros_like(block, order="F")
        rhs = _wrap(block, self._system.n_dofs, self._system.comm)
        out = _wrap(solution, self._system.n_dofs, self._system.comm)
        self._factor.matSolve(rhs, out)
        rhs.destroy()
        out.destroy()
        return solution

    def destroy(self) -> None:
        """Free the factorisation."""
        self._pc.destroy()
        self._matrix.destroy()


def _wrap(block: Array, rows: int, comm: MPI.Comm) -> Any:
    """PETSc view of a Fortran-ordered block, without a copy."""
    if not block.flags.f_contiguous:
        raise ValueError("blocks of vectors must be Fortran-contiguous")
    size = ((block.shape[0], rows), (None, block.shape[1]))
    dense = PETSc.Mat().createDense(size, array=block, comm=comm)
    dense.assemble()
    return dense
