"""The lowest modes of the fine solid from those of its coarse mesh, without factorising it.

Prolonged to the fine nodes, coarse modes are in the right place but far too stiff. A few steps of
locally optimal block preconditioned conjugate gradients (Knyazev 2001) mend that, whose
preconditioner is a two-grid cycle: a sweep of damped block Jacobi over the nodes, a solve on the
coarse mesh, and the sweep again. All it takes of the fine matrices are products.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI
from numpy.typing import NDArray

from carillon.errors import UserError
from carillon.fem.geometry import Blocks, prolongation
from carillon.fem.model import ElasticModel
from carillon.runtime import available_memory
from solver.assembly.system import Layout, System, assemble
from solver.coarsening.linear import LinearCoarsening
from solver.coarsening.model import coarse_model, element_moduli
from solver.distribution.local_mesh import distribute
from solver.linear import LinearSolver
from solver.subspace.rayleigh_ritz import remove_rigid, ritz_pairs, safe_shift

Array = NDArray[np.float64]

STEPS = 3
"""Steps; each takes about nine tenths of the error of the eigenvalues that is left."""

MOST_VECTORS = 66
"""Elastic modes that are usually corrected; see `solver.refinement.estimate.MODES_USED`."""

BLOCKS, NODES_AROUND = 18, 27
"""Blocks of so many vectors that exist together, and nodes that share an element with one."""

DAMPING = 0.6
"""Of the sweeps: below two over the largest eigenvalue of D^-1 K, which is less than three."""


class TwoGrid:
    """A fine solid whose lowest modes are found from those of any of its coarse meshes.

    Parameters
    ----------
    fine
        The fine model, with one modulus a cell. It is assembled once, on this rank alone.
    threads
        Threads for products with blocks of vectors.

    Raises
    ------
    UserError
        If its matrices and vectors would not fit in memory.
    """

    def __init__(self, fine: ElasticModel, threads: int = 1) -> None:
        _require_memory(fine)
        self.fine = fine
        self._threads = threads
        layout = _layout(fine)
        self.system = assemble(layout.local_mesh, MPI.COMM_SELF, layout, threads=threads)
        self._inverse = np.linalg.inv(_diagonal_blocks(self.system))

    def lowest(
        self, blocks: Blocks, coarse_modes: Array, steps: int = STEPS
    ) -> tuple[Array, Array]:
        """Ritz values (k,) [rad^2/s^2] and mass-orthonormal vectors (n_dofs, k) of the fine solid.

        Parameters
        ----------
        blocks
            The fine mesh and the coarse one, which may be mixed.
        coarse_modes
            (coarse n_dofs, k) elastic modes of any coarse model on it, which the answer's number
            is that of.
        steps
            Number of corrections; the values fall with each.
        """
        system, count = self.system, coarse_modes.shape[1]
        interpolation = sp.kron(prolongation(blocks), sp.identity(3), format="csr")
        restriction = interpolation.T.tocsr()
        coarse = _CoarseSolve(blocks, self.fine, self._threads)
        start = self._with_products(interpolation @ coarse_modes)
        values, vectors, origin = self._ritz(start, None, count)
        for _ in range(steps):
            residual = vectors.mass * values - vectors.stiff
            step = self._sweep(residual)
            left = restriction @ (residual - system.times_stiffness(step))
            step += interpolation @ coarse.solve(left)
            step += self._sweep(residual - system.times_stiffness(step))
            values, vectors, origin = self._ritz(
                vectors, _joined(self._with_products(step), origin), count
            )
        return values, vectors.block

    def _with_products(self, block: Array) -> _Products:
        block, mass = remove_rigid(self.system, np.ascontiguousarray(block))
        return _Products(block, self.system.times_stiffness(block), mass)

    def _ritz(
        self, vectors: _Products, others: _Products | None, count: int
    ) -> tuple[Array, _Products, _Products | None]:
        """Ritz values, vectors, and the vectors' part in the span of `others`."""
        values, weights = ritz_pairs(self.system, *_joined(vectors, others))
        values, weights = values[:count], np.ascontiguousarray(weights[:, :count])
        kept = vectors.block.shape[1]
        ritz = vectors.combined(weights[:kept])
        if others is None:
            return values, ritz, None
        origin = others.combined(weights[kept:])
        return values, _Products(*(a + b for a, b in zip(ritz, origin))), origin

    def _sweep(self, residual: Array) -> Array:
        nodes = residual.reshape(len(self._inverse), 3, -1)
        return np.asarray(DAMPING * (self._inverse @ nodes).reshape(residual.shape))


class _Products(NamedTuple):
    """A block of vectors (n_dofs, m) and its products with K and M."""

    block: Array
    stiff: Array
    mass: Array

    def combined(self, weights: Array) -> _Products:
        """The same of combinations (m, k) of the vectors."""
        return _Products(*(each @ weights for each in self))


def _joined(first: _Products, second: _Products | None) -> _Products:
    if second is None:
        return first
    return _Products(*(np.hstack(pair) for pair in zip(first, second)))


class _CoarseSolve:
    """The fine stiffness on the coarse mesh, P^T K P with a shift, as a factorisation."""

    def __init__(self, blocks: Blocks, fine: ElasticModel, threads: int) -> None:
        young = element_moduli(blocks, fine.young[:, 0], LinearCoarsening("galerkin"))
        model = coarse_model(blocks, young, poisson=fine.poisson, density=fine.density)
        layout = _layout(model)
        system = assemble(layout.local_mesh, MPI.COMM_SELF, layout, threads=threads)
        solver = LinearSolver("multifrontal", layout)
        self._inverse = solver.inverse(system, -safe_shift(system))

    def solve(self, block: Array) -> Array:
        """Solutions for a block of right-hand sides (coarse n_dofs, k)."""
        return self._inverse.solve(np.ascontiguousarray(block))


def _require_memory(fine: ElasticModel) -> None:
    entries = NODES_AROUND * fine.mesh.n_nodes * (9 + 1) + 64 * fine.mesh.n_cells
    needed = 8 * (entries + BLOCKS * MOST_VECTORS * fine.n_dofs)
    free = available_memory()
    if free is not None and needed > free:
        raise UserError(
            f"the error of a coarse model of {fine.n_dofs:,} fine unknowns takes about "
            f"{needed / 1e9:,.1f} GB to estimate, {free / 1e9:,.1f} GB are free; leave it out with "
            "--refine-to 0 or lower --resolution"
        )


def _layout(model: ElasticModel) -> Layout:
    """Layout of a whole model on this rank, in the mesh's own order of nodes."""
    return Layout.of_local_mesh(distribute(model, 1, comm=MPI.COMM_SELF), MPI.COMM_SELF)


def _diagonal_blocks(system: System) -> Array:
    """Blocks (n, 3, 3) of K on the diagonal."""
    pattern = system.rows.pattern
    row = np.repeat(np.arange(len(pattern.indptr) - 1), np.diff(pattern.indptr))
    return np.asarray(system.rows.stiffness[row == pattern.columns])
