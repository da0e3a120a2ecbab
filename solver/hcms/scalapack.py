"""Dense eigenproblems shared by several ranks: ScaLAPACK, which MUMPS brings along.

It is called in the library that petsc4py has loaded, so that it is the one for PETSc's MPI.
Matrices lie in blocks dealt out cyclically over a grid of ranks.
"""

import ctypes
import math
from ctypes import byref, c_double, c_int, c_void_p
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import blas

from carillon.arrays import Array, Index
from carillon.processes import extras
from carillon.processes.mpi import MPI
from solver.distribution.collective import receive_arrays, send_arrays
from solver.hcms.counts import Tally, count_shared_eigenproblem
from solver.hcms.merge import Reduced

BLOCK = 32
"""Rows and columns of a block."""
ITEMS_OF_DESCRIPTOR = 9
_ROUTINES = ("pdpotrf_", "pdsyngst_", "pdsyevd_", "pdtrsm_", "Csys2blacs_handle")
_ONE = byref(c_int(1))

CHECK_TOLERANCE = 1e-8
"""Largest relative error of the eigenvectors' products with K and M."""
_PENCIL, _VECTORS = 21, 22


def available() -> bool:
    """Whether PETSc is installed, with a ScaLAPACK that has what is needed here."""
    if not extras.is_installed(extras.PETSC):
        return False
    library = _library()
    return all(hasattr(library, name) for name in _ROUTINES)


def grid_side(ranks: int) -> int:
    """Rows, and columns, of the largest square grid of at most so many ranks.

    Two ranks are no grid: the tridiagonalisation is shared in square ones alone.

    Examples
    --------
    >>> [grid_side(ranks) for ranks in (1, 2, 3, 4, 15)]
    [1, 1, 1, 2, 3]
    """
    return math.isqrt(ranks)


def places(size: int, rank: int, ranks: int) -> tuple[Index, Index]:
    """Rows and columns of a matrix of order `size` that one of so many ranks holds."""
    block = np.arange(size) // BLOCK
    side = grid_side(ranks)
    row, column = divmod(rank, side)
    return np.flatnonzero(block % side == row), np.flatnonzero(block % side == column)


class ProcessGrid:
    """Ranks that share matrices of one size; collective, to be closed at the end."""

    def __init__(self, comm: MPI.Comm, size: int) -> None:
        self._library = _library()
        self.size = size
        self._handle = self._library.Csys2blacs_handle(_c_communicator(comm))
        self._context, side = c_int(self._handle), grid_side(comm.size)
        self._library.Cblacs_gridinit(byref(self._context), b"Row", side, side)
        rows, columns = places(size, comm.rank, comm.size)
        self._local = len(rows), len(columns)
        # Dense, context, order, blocks, the first block's owner, leading dimension.
        self._descriptor = (c_int * ITEMS_OF_DESCRIPTOR)(
            1, self._context.value, size, size, BLOCK, BLOCK, 0, 0, max(1, len(rows))
        )

    def eigenpairs(self, stiffness: Array, mass: Array | None) -> tuple[Array, Array]:
        """All eigenpairs of the pencil whose lower triangles lie in the ranks' parts of K and M.

        Both are overwritten; M is None if it is I. Returns values (n,), ascending, on every rank,
        and this rank's part of the M-orthonormal vectors.
        """
        scale = c_double(1.0)
        if mass is not None:
            self._call("pdpotrf_", b"L", self._order, *self._matrix(mass))
            matrices = *self._matrix(stiffness), *self._matrix(mass)
            one = _ONE
            self._call("pdsyngst_", one, b"L", self._order, *matrices, byref(scale), spaces=1)
        values, vectors = np.empty(self.size), np.empty(self._local, order="F")
        of_values = *self._matrix(stiffness), _pointer(values)
        self._call(
            "pdsyevd_", b"V", b"L", self._order, *of_values, *self._matrix(vectors), spaces=2
        )
        if mass is not None:
            alpha = byref(c_double(1.0))
            self._library.pdtrsm_(
                *(b"L", b"L", b"T", b"N", self._order, self._order, alpha),
                *self._matrix(mass),
                *self._matrix(vectors),
            )
        return scale.value * values, vectors

    def close(self) -> None:
        """Give the grid back."""
        self._library.Cblacs_gridexit(self._context)
        self._library.Cfree_blacs_system_handle(self._handle)

    @property
    def _order(self) -> Any:
        return byref(c_int(self.size))

    def _matrix(self, local: Array) -> tuple[Any, ...]:
        return _pointer(local), _ONE, _ONE, self._descriptor

    def _call(self, name: str, *arguments: Any, spaces: int = 0) -> None:
        """Call a routine with as much space as it asks for, of reals, then of integers."""
        routine, info = getattr(self._library, name), c_int()
        kinds = (np.float64, np.int32)[:spaces]
        asked = [np.empty(1, dtype=kind) for kind in kinds]
        if spaces:
            routine(*arguments, *_lengths(asked, [-1] * spaces), byref(info))
        # Of small matrices, pdsyevd asks for less than the routines that it calls.
        more = 4 * BLOCK * (sum(self._local) + BLOCK)
        given = [np.empty(int(each[0]) + more, dtype=kind) for each, kind in zip(asked, kinds)]
        routine(*arguments, *_lengths(given, [len(each) for each in given]), byref(info))
        if info.value != 0:
            raise np.linalg.LinAlgError(f"{name.strip('_')} of ScaLAPACK: info {info.value}")


@cache
def _library() -> ctypes.CDLL:
    from carillon.processes.petsc import PETSc

    return ctypes.CDLL(PETSc.__file__)


def _lengths(spaces: list[NDArray[Any]], lengths: list[int]) -> list[Any]:
    """Arguments of a routine: each space and its length."""
    return [
        argument
        for space, length in zip(spaces, lengths, strict=True)
        for argument in (_pointer(space), byref(c_int(length)))
    ]


def _pointer(array: NDArray[Any]) -> c_void_p:
    return array.ctypes.data_as(c_void_p)


def _c_communicator(comm: MPI.Comm) -> Any:
    """The handle as C has it, an integer or a pointer."""
    kind: Any = c_int if MPI._sizeof(MPI.Comm) == ctypes.sizeof(c_int) else c_void_p
    return kind.from_address(MPI._addressof(comm))


def shared_pairs(
    comm: MPI.Comm, reduced: Reduced | None, tally: Tally
) -> tuple[Array, Array] | None:
    """All eigenpairs of the pencil that rank 0 of `comm` has, on rank 0; collective.

    They are those of `solver.hcms.merge.all_pairs` but for rounding, and the signs of the vectors.
    Returns values (n,) and vectors (n, n); None on the other ranks. Raises numpy.linalg.LinAlgError
    if ScaLAPACK does not converge, on the ranks that it tells, or its vectors are wrong.
    """
    if reduced is None:
        _help(comm, tally)
        return None
    order = len(reduced.stiffness)
    matrices = [matrix for matrix in reduced if matrix is not None]

    def part(rank: int) -> list[Array]:
        """Of either matrix, as rows of the transpose: columns are contiguous there."""
        rows, columns = places(order, rank, comm.size)
        return [np.ascontiguousarray(matrix[np.ix_(rows, columns)].T) for matrix in matrices]

    sent = [
        tally.sent(send_arrays(comm, [np.array([order]), *part(rank)], rank, _PENCIL))
        for rank in range(1, comm.size)
    ]
    K, *M = part(0)
    grid = ProcessGrid(comm, order)
    values, vectors = grid.eigenpairs(K.T, M[0].T if M else None)
    for messages in sent:
        messages.wait()
    count_shared_eigenproblem(tally, order, bool(M), comm.size)
    whole = np.empty((order, order), order="F")
    whole[np.ix_(*places(order, 0, comm.size))] = vectors
    for rank in range(1, comm.size):
        with tally.idle():
            (columns,) = receive_arrays(comm, rank, _VECTORS)
        whole[np.ix_(*places(order, rank, comm.size))] = columns.T
    grid.close()
    _check(reduced, values, whole)
    return values, whole


def _help(comm: MPI.Comm, tally: Tally) -> None:
    with tally.idle():
        order, K, *M = receive_arrays(comm, 0, _PENCIL)
    grid = ProcessGrid(comm, int(order[0]))
    _, vectors = grid.eigenpairs(K.T, M[0].T if M else None)
    count_shared_eigenproblem(tally, int(order[0]), bool(M), comm.size)
    tally.sent(send_arrays(comm, [vectors.T], 0, _VECTORS)).wait()
    grid.close()


def _check(reduced: Reduced, values: Array, vectors: Array) -> None:
    """Raise an error unless Q^T K Q x = D x and Q^T M Q x = x: ScaLAPACK hides some faults."""
    x = np.ones(len(values))
    for matrix, expected in ((reduced.stiffness, values), (reduced.mass, x)):
        product = vectors @ x
        if matrix is not None:
            product = blas.dsymv(1.0, matrix, product, lower=1)
        if np.abs(vectors.T @ product - expected).max() > CHECK_TOLERANCE * np.abs(expected).max():
            raise np.linalg.LinAlgError("ScaLAPACK's eigenvectors do not diagonalise the pencil")
