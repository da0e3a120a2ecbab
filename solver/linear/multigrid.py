"""Smoothed aggregation multigrid (Vanek, Mandel & Brezina 1996) on blocks of right-hand sides.

PETSc's GAMG makes the levels.  It would apply them to one right-hand side at a time; here a V-cycle
carries a row-major block, so that every entry of a level's matrix meets whole rows of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
import scipy.linalg as la
from mpi4py import MPI
from numpy.typing import NDArray

from carillon.processes.petsc import PETSc
from carillon.processes.threads import in_parallel, split
from solver.linear.block_rows import BlockRows
from solver.linear.petsc_options import MULTIGRID_PREFIX

Array = NDArray[np.floating]

THRESHOLD = 0.0
"""Largest coupling, relative to the diagonal, that does not join an aggregate."""
COARSEST_UNKNOWNS = 600
"""Largest number of unknowns of the coarsest level, whose matrix is inverted."""
SMOOTHED_SPECTRUM = (0.1, 1.1)
"""Interval that the smoother damps, as fractions of the largest eigenvalue's estimate; above one,
since the estimate comes from below."""
LANCZOS_STEPS = 20
"""Lanczos steps of the estimate of the largest eigenvalue."""
EXHAUSTED = 1e-6
"""Size of a next Lanczos vector, relative to the matrix, below which it is rounding."""


class Multigrid:
    """A symmetric V-cycle: two Chebyshev-Jacobi steps before and after every coarse correction.

    Parameters
    ----------
    matrix
        Symmetric positive definite PETSc matrix (AIJ, block size 3).
    near_null
        (local, 6) rigid motions: what smoothing cannot reduce, and coarse levels must represent.
    dtype
        Numbers that the cycle computes with.  Single precision halves the traffic of memory, and is
        enough for a preconditioner.
    """

    def __init__(
        self,
        matrix: Any,
        near_null: Array,
        comm: MPI.Comm,
        dtype: Any = np.float32,
        threads: int = 1,
    ) -> None:
        self._dtype = np.dtype(dtype)
        self._threads = threads
        pc = _aggregate(matrix, near_null, comm)
        count = pc.getMGLevels()
        self._levels = [self._level(pc, number, comm) for number in range(count - 1, 0, -1)]
        coarsest, _ = pc.getMGSmoother(0).getOperators()
        self._coarsest = _Inverse(coarsest, comm, self._dtype)
        self.sizes = [
            pc.getMGSmoother(number).getOperators()[0].getSize()[0] for number in range(count)
        ]
        pc.destroy()

    def apply(self, block: Array) -> Array:
        """One V-cycle from zero for a block of right-hand sides (local, k); collective."""
        return self._cycle(0, block.astype(self._dtype)).astype(block.dtype)

    def destroy(self) -> None:
        """Free the levels."""
        self._levels.clear()

    def _level(self, pc: Any, number: int, comm: MPI.Comm) -> _Level:
        matrix, _ = pc.getMGSmoother(number).getOperators()
        interpolation = pc.getMGInterpolation(number)
        restriction = interpolation.transpose(PETSc.Mat())
        rows, prolong, restrict = (
            BlockRows(each, comm, self._dtype, self._threads)
            for each in (matrix, interpolation, restriction)
        )
        restriction.destroy()
        diagonal = rows.diagonal()
        # An aggregate of two nodes or one has fewer motions than its six coarse unknowns: what is
        # interpolated from the others is zero.
        used = diagonal > 0.0
        scale = np.divide(1.0, diagonal, out=np.zeros_like(diagonal), where=used)
        return _Level(rows, prolong, restrict, scale, _largest_eigenvalue(rows, scale, comm))

    def _cycle(self, number: int, rhs: Array) -> Array:
        if number == len(self._levels):
            return self._coarsest.apply(rhs)
        level = self._levels[number]
        solution = np.zeros_like(rhs)
        residual = rhs.copy()
        self._smooth(level, solution, residual)
        correction = self._cycle(number + 1, level.restrict.times(residual))
        level.prolong.add_product(correction, solution)
        residual[:] = rhs
        level.rows.add_product(solution, residual, -1.0)
        self._smooth(level, solution, residual, last=True)
        return solution

    def _smooth(self, level: _Level, solution: Array, residual: Array, last: bool = False) -> None:
        """Improve `solution`, and update `residual` unless nobody needs it afterwards."""
        low, high = (share * level.largest for share in SMOOTHED_SPECTRUM)
        centre, half = 0.5 * (high + low), 0.5 * (high - low)
        ratio = half / centre
        step = np.empty_like(residual)
        self._step(level, step, residual, solution, 0.0, 1.0 / centre)
        level.rows.add_product(step, residual, -1.0)
        following = 1.0 / (2.0 / ratio - ratio)
        self._step(level, step, residual, solution, ratio * following, 2.0 * following / half)
        if not last:
            level.rows.add_product(step, residual, -1.0)

    def _step(
        self, level: _Level, step: Array, residual: Array, solution: Array, old: float, new: float
    ) -> None:
        """step = old * step + new * D^-1 residual, added to the solution."""
        real = self._dtype.type

        def rows(start: int, stop: int) -> None:
            _take_step(start, stop, level.scale, step, residual, solution, real(old), real(new))

        count = len(step)
        in_parallel(rows, split(count, self._threads, max(count, 1)), self._threads)


@dataclass(frozen=True)
class _Level:
    """A level above the coarsest: its matrix, the way from and to the next, its smoother."""

    rows: BlockRows
    prolong: BlockRows
    restrict: BlockRows
    scale: Array
    largest: float


class _Inverse:
    def __init__(self, matrix: Any, comm: MPI.Comm, dtype: Any) -> None:
        self._comm = comm
        size = matrix.getSize()[0]
        start, stop = matrix.getOwnershipRange()
        indptr, columns, values = matrix.getValuesCSR()
        own = np.zeros((stop - start, size))
        own[np.repeat(np.arange(stop - start), np.diff(indptr)), columns] = values
        self._counts = comm.allgather(stop - start)
        # Aggregates of few nodes may leave a coarse unknown without stiffness.
        inverse = np.linalg.pinv(self._gather(own), rcond=1e-12, hermitian=True)
        self._rows = inverse[start:stop].astype(dtype)

    def apply(self, block: Array) -> Array:
        """Product with `block` (local, k); collective."""
        return np.asarray(self._rows @ self._gather(block))

    def _gather(self, own: Array) -> Array:
        columns = own.shape[1]
        whole = np.empty((sum(self._counts), columns), dtype=own.dtype)
        counts = [count * columns for count in self._counts]
        self._comm.Allgatherv(np.ascontiguousarray(own), (whole, counts))
        return whole


def _aggregate(matrix: Any, near_null: Array, comm: MPI.Comm) -> Any:
    """GAMG preconditioner whose levels are set up; `near_null` is made orthonormal for PETSc."""
    gram = near_null.T @ near_null
    comm.Allreduce(MPI.IN_PLACE, gram)
    orthonormal = np.linalg.solve(np.linalg.cholesky(gram), near_null.T)
    vectors = [PETSc.Vec().createWithArray(each.copy(), comm=comm) for each in orthonormal]
    motions = PETSc.NullSpace().create(vectors=vectors, comm=comm)
    matrix.setNearNullSpace(motions)
    settings = {
        "pc_type": "gamg",
        "pc_gamg_type": "agg",
        "pc_gamg_threshold": THRESHOLD,
        "pc_gamg_coarse_eq_limit": COARSEST_UNKNOWNS,
    }
    options = PETSc.Options(MULTIGRID_PREFIX)
    for name, value in settings.items():
        options[name] = value
    everywhere = PETSc.Options()
    if comm.size > 1:
        # By default PETSc adds other ranks' parts of a coarse matrix in the order they arrive in.
        everywhere["matptap_via"] = "allatonce"
    pc = PETSc.PC().create(comm)
    pc.setOptionsPrefix(MULTIGRID_PREFIX)
    pc.setOperators(matrix)
    pc.setFromOptions()
    for name in settings:
        options.delValue(name)
    pc.setUp()
    everywhere.delValue("matptap_via")
    motions.destroy()
    for vector in vectors:
        vector.destroy()
    return pc


def _largest_eigenvalue(rows: BlockRows, scale: Array, comm: MPI.Comm) -> float:
    """Estimate by Lanczos' method, from below, of the largest eigenvalue of D^-1 A.

    `scale` is the diagonal of D^-1.  All ranks get the same bits.
    """
    root = np.sqrt(scale)[:, None]

    def product(left: Array, right: Array) -> float:
        return float(comm.allreduce(np.vdot(left, right)))

    vector = np.random.default_rng(comm.rank).standard_normal(root.shape).astype(root.dtype)
    vector *= root > 0.0
    before = np.zeros_like(vector)
    diagonal: list[float] = []
    off_diagonal = [np.sqrt(product(vector, vector))]
    for _ in range(LANCZOS_STEPS):
        vector /= root.dtype.type(off_diagonal[-1])
        image = root * rows.times(root * vector)
        diagonal.append(product(vector, image))
        image -= root.dtype.type(diagonal[-1]) * vector
        image -= root.dtype.type(off_diagonal[-1] if len(diagonal) > 1 else 0.0) * before
        before, vector = vector, image
        off_diagonal.append(np.sqrt(product(vector, vector)))
        if off_diagonal[-1] <= EXHAUSTED * diagonal[0]:
            break
    return float(la.eigvalsh_tridiagonal(diagonal, off_diagonal[1 : len(diagonal)])[-1])


@numba.njit(cache=True, nogil=True, fastmath={"contract"}, error_model="numpy")
def _take_step(  # type: ignore[no-untyped-def]
    start, stop, scale, step, residual, solution, old, new
):
    width = step.shape[1]
    for row in range(start, stop):
        weight = new * scale[row]
        d, r, x = step[row], residual[row], solution[row]
        if old == 0.0:
            for k in range(width):
                d[k] = weight * r[k]
                x[k] += d[k]
        else:
            for k in range(width):
                d[k] = old * d[k] + weight * r[k]
                x[k] += d[k]
