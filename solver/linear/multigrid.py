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

from carillon.arrays import Array
from carillon.numerics.simd_width import LANES
from carillon.processes.memory import give_back_freed_memory
from carillon.processes.mpi import MPI
from carillon.processes.petsc import PETSc
from solver.assembly.row_products import RowProducts
from solver.linear.block_rows import block_rows, diagonal
from solver.linear.petsc_options import MULTIGRID_PREFIX

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
        Symmetric positive definite PETSc matrix (AIJ, block size 3), which is freed.
    near_null
        (local, 6) rigid motions: what smoothing cannot reduce, and coarse levels must represent.
    finest
        This rank's rows of the matrix, or of one that hardly differs from it; copied from it if
        not given.
    """

    def __init__(
        self,
        matrix: Any,
        near_null: Array,
        comm: MPI.Comm,
        finest: RowProducts | None = None,
        threads: int = 1,
    ) -> None:
        pc = _aggregate(matrix, near_null, comm)
        numbers = range(pc.getMGLevels())
        matrices = [pc.getMGSmoother(number).getOperators()[0] for number in numbers]
        interpolations = [pc.getMGInterpolation(number) for number in numbers[1:]]
        self.sizes = [each.getSize()[0] for each in matrices]
        self._coarsest = _Inverse(matrices[0], comm)
        rows = [block_rows(each, comm, threads) for each in matrices[1:-1]]
        rows.append(block_rows(matrix, comm, threads) if finest is None else finest)
        # petsc4py keeps for later what its garbage collector is the last to let go; of the coarse
        # matrices each holds the finer one.
        for each in (*matrices, pc, matrix):
            each.destroy()
        give_back_freed_memory()
        self._levels = []
        for of_level, interpolation in zip(rows[::-1], interpolations[::-1], strict=True):
            self._levels.append(_Level.of(of_level, interpolation, comm))
            interpolation.destroy()

    def apply(self, block: Array) -> Array:
        """One V-cycle from zero for a block of right-hand sides (local, k); collective."""
        width = block.shape[1]
        if width >= LANES:
            return self._cycle(0, np.ascontiguousarray(block))
        padded = np.zeros((len(block), LANES))
        padded[:, :width] = block
        return np.ascontiguousarray(self._cycle(0, padded)[:, :width])

    def destroy(self) -> None:
        """Free the levels."""
        self._levels.clear()

    def _cycle(self, number: int, rhs: Array) -> Array:
        if number == len(self._levels):
            return self._coarsest.apply(rhs)
        level = self._levels[number]
        scale, first, following = level.scale, level.first, level.following
        one, other, residual, solution = (np.empty_like(rhs) for _ in range(4))

        def second_step(here: slice, image: Array) -> None:
            columns = rhs[here], image, scale[here], one[here]
            _second_step(*columns, residual[here], other[here], solution[here], *following)

        def what_is_left(here: slice, image: Array) -> None:
            residual[here] -= image

        def correct(here: slice, image: Array) -> None:
            solution[here] += image

        def first_step(here: slice, image: Array) -> None:
            _first_step(rhs[here], image, scale[here], residual[here], one[here], first)

        def last_step(here: slice, image: Array) -> None:
            columns = residual[here], image, scale[here], one[here]
            _last_step(*columns, solution[here], *following)

        np.multiply(rhs, (first * scale)[:, None], out=one)
        level.rows.by_rows(one, second_step)
        level.rows.by_rows(other, what_is_left)
        coarse = self._cycle(number + 1, level.restrict.times(residual))
        level.prolong.by_rows(coarse, correct)
        level.rows.by_rows(solution, first_step)
        level.rows.by_rows(one, last_step)
        return solution


@dataclass(frozen=True)
class _Level:
    """A level above the coarsest: its matrix, the way from and to the next, its smoother."""

    rows: RowProducts
    prolong: RowProducts
    restrict: RowProducts
    scale: Array
    """(local,) inverse of the diagonal D, zero where that is zero."""
    first: float
    """The first Chebyshev step is so many times D^-1 r."""
    following: tuple[float, float]
    """The second one is so many times the first, and so many times D^-1 r."""

    @classmethod
    def of(cls, rows: RowProducts, interpolation: Any, comm: MPI.Comm) -> _Level:
        """Level of a matrix, from the interpolation (PETSc) of the next; collective."""
        restriction = interpolation.transpose(PETSc.Mat())
        prolong, restrict = (
            block_rows(each, comm, rows.threads) for each in (interpolation, restriction)
        )
        restriction.destroy()
        entries = diagonal(rows)
        # An aggregate of two nodes or one has fewer motions than its six coarse unknowns: what is
        # interpolated from the others is zero.
        scale = np.divide(1.0, entries, out=np.zeros_like(entries), where=entries > 0.0)
        largest = _largest_eigenvalue(rows, scale, comm)
        low, high = (share * largest for share in SMOOTHED_SPECTRUM)
        centre, half = 0.5 * (high + low), 0.5 * (high - low)
        ratio = half / centre
        growth = 1.0 / (2.0 / ratio - ratio)
        following = ratio * growth, 2.0 * growth / half
        return cls(rows, prolong, restrict, scale, 1.0 / centre, following)


class _Inverse:
    def __init__(self, matrix: Any, comm: MPI.Comm) -> None:
        self._comm = comm
        size = matrix.getSize()[0]
        start, stop = matrix.getOwnershipRange()
        indptr, columns, values = matrix.getValuesCSR()
        own = np.zeros((stop - start, size))
        own[np.repeat(np.arange(stop - start), np.diff(indptr)), columns] = values
        self._counts = comm.allgather(stop - start)
        # Aggregates of few nodes may leave a coarse unknown without stiffness.
        inverse = np.linalg.pinv(self._gather(own), rcond=1e-12, hermitian=True)
        self._rows = np.ascontiguousarray(inverse[start:stop])

    def apply(self, block: Array) -> Array:
        """Product with `block` (local, k); collective."""
        return np.asarray(self._rows @ self._gather(block))

    def _gather(self, own: Array) -> Array:
        columns = own.shape[1]
        whole = np.empty((sum(self._counts), columns))
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
        everywhere["matptap_via"] = "backend"
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


def _largest_eigenvalue(rows: RowProducts, scale: Array, comm: MPI.Comm) -> float:
    """Estimate by Lanczos' method, from below, of the largest eigenvalue of D^-1 A.

    `scale` is the diagonal of D^-1.  All ranks get the same bits.
    """
    root = np.sqrt(scale)[:, None]

    def product(left: Array, right: Array) -> float:
        return float(comm.allreduce(np.vdot(left, right)))

    vector = np.random.default_rng(comm.rank).standard_normal(root.shape)
    vector *= root > 0.0
    before = np.zeros_like(vector)
    diagonal: list[float] = []
    off_diagonal = [np.sqrt(product(vector, vector))]
    for _ in range(LANCZOS_STEPS):
        vector /= off_diagonal[-1]
        image = root * rows.times(root * vector)
        diagonal.append(product(vector, image))
        image -= diagonal[-1] * vector
        image -= (off_diagonal[-1] if len(diagonal) > 1 else 0.0) * before
        before, vector = vector, image
        off_diagonal.append(np.sqrt(product(vector, vector)))
        if off_diagonal[-1] <= EXHAUSTED * diagonal[0]:
            break
    return float(la.eigvalsh_tridiagonal(diagonal, off_diagonal[1 : len(diagonal)])[-1])


@numba.njit(cache=True, nogil=True, fastmath={"contract"}, error_model="numpy")
def _first_step(rhs, image, scale, residual, step, first):  # type: ignore[no-untyped-def]
    for row in range(len(scale)):
        weight = first * scale[row]
        for k in range(rhs.shape[1]):
            residual[row, k] = rhs[row, k] - image[row, k]
            step[row, k] = weight * residual[row, k]


@numba.njit(cache=True, nogil=True, fastmath={"contract"}, error_model="numpy")
def _second_step(  # type: ignore[no-untyped-def]
    rhs, image, scale, before, residual, step, solution, old, new
):
    for row in range(len(scale)):
        weight = new * scale[row]
        for k in range(rhs.shape[1]):
            residual[row, k] = rhs[row, k] - image[row, k]
            step[row, k] = old * before[row, k] + weight * residual[row, k]
            solution[row, k] = before[row, k] + step[row, k]


@numba.njit(cache=True, nogil=True, fastmath={"contract"}, error_model="numpy")
def _last_step(residual, image, scale, before, solution, old, new):  # type: ignore[no-untyped-def]
    for row in range(len(scale)):
        weight = new * scale[row]
        for k in range(residual.shape[1]):
            left = residual[row, k] - image[row, k]
            solution[row, k] += (1.0 + old) * before[row, k] + weight * left
