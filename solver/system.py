"""The assembled eigenvalue problem on distributed rows, and dense blocks of vectors over it.

Rows follow a `Decomposition`: each rank owns the unknowns of its subdomains.  A block of vectors is
a Fortran-ordered numpy array with this rank's rows; products and solves take and return them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from dataset_gen.block import degrees_of_freedom
from dataset_gen.element import rigid_motions
from solver.decomposition import Decomposition
from solver.eigensolver import distributed_matrix, factor_package
from solver.model import ElasticModel
from solver.sparse import assemble_elements

Array = NDArray[np.float64]


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
    order
        (n,) node numbers in distributed order.
    start, stop
        Half-open range of this rank's nodes in `order`.
    """

    K: Any
    M: Any
    rigid: Array
    coordinates: Array
    order: NDArray[np.int64]
    start: int
    stop: int
    comm: MPI.Comm

    @property
    def n_dofs(self) -> int:
        """Number of unknowns over all ranks."""
        return 3 * len(self.order)

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
        own = degrees_of_freedom(self.order[self.start : self.stop])
        return np.asfortranarray(block[own])

    def gather(self, block: Array) -> Array | None:
        """Whole block in mesh node order on rank 0, None elsewhere; columns travel one by one."""
        columns = block.shape[1]
        counts = self.comm.gather(block.shape[0])
        whole = np.empty((self.n_dofs, columns), order="F") if self.comm.rank == 0 else None
        dofs = degrees_of_freedom(self.order)
        received = np.empty(self.n_dofs)
        for column in range(columns):
            local = np.ascontiguousarray(block[:, column])
            self.comm.Gatherv(local, (received, counts) if self.comm.rank == 0 else None)
            if whole is not None:
                whole[dofs, column] = received
        return whole

    def destroy(self) -> None:
        """Free the PETSc matrices."""
        self.K.destroy()
        self.M.destroy()


def assemble(
    model: ElasticModel, decomposition: Decomposition, comm: MPI.Comm = MPI.COMM_WORLD
) -> System:
    """Assemble stiffness and mass; every rank assembles the rows of the nodes that it owns."""
    start, stop = decomposition.local_range(comm.rank)
    n_nodes = model.mesh.n_nodes
    number = np.empty(n_nodes, dtype=np.int64)
    number[decomposition.order] = np.arange(n_nodes)
    cells = number[model.mesh.cells]
    touching = np.flatnonzero(((cells >= start) & (cells < stop)).any(axis=1))
    row_of = np.full(n_nodes, -1, dtype=np.int64)
    row_of[start:stop] = np.arange(stop - start)
    K_rows, M_rows = assemble_elements(
        cells[touching],
        model.stiffness(touching),
        model.nodal_mass(touching),
        stop - start,
        n_nodes,
        row_of,
    )
    K = distributed_matrix(K_rows, comm)
    M = distributed_matrix(M_rows, comm)
    centred = model.mesh.nodes - model.mesh.nodes.mean(axis=0)
    scaled = centred / np.abs(centred).max()
    own = decomposition.order[start:stop]
    # About the centroid of the whole body: every rank must hold rows of the same six motions.
    motions = np.asfortranarray(rigid_motions(scaled).reshape(-1, 3, 6)[own].reshape(-1, 6))
    system = System(K, M, motions, scaled[own], decomposition.order, start, stop, comm)
    gram = system.inner(motions, system.multiply(M, motions))
    rigid = np.asfortranarray(np.linalg.solve(np.linalg.cholesky(gram), motions.T).T)
    return replace(system, rigid=rigid)


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
