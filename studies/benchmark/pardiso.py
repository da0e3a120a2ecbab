"""PARDISO of Intel's MKL, which pypardiso finds: symmetric factorisations and solves of blocks."""

import ctypes
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from carillon.arrays import Array
from carillon.errors import ConvergenceError
from studies.benchmark.direct_solver import DirectSolver

Integers = NDArray[np.int32]
DEFINITE, INDEFINITE = 2, -2
"""PARDISO's types of real matrices: symmetric positive definite, and symmetric."""
_ANALYSE, _FACTORISE, _SOLVE, _RELEASE = 11, 22, 33, -1
"""Phases of a call."""
_SETTINGS = {1: 1, 2: 2, 18: -1, 19: -1, 24: 1}
"""Elements of IPARM, counted from 1: no defaults, nested dissection by METIS, counts of entries and
operations, and the factorisation in two levels, a tenth faster than the classic one."""
_PIVOTING = {10: 8, 21: 1}
"""The same of indefinite matrices: perturbation of tiny pivots by 1e-8, pivots of Bunch and
Kaufman."""
_ENTRIES, _MEGAFLOP, _LEVELS = 18, 19, 24
_CLASSIC = 0
"""Value of the element `_LEVELS` without which no operations are counted."""


class Pardiso(DirectSolver):
    """L D L^T of a symmetric matrix, or Cholesky factorisation of a definite one.

    Each method raises ConvergenceError if PARDISO reports an error. `destroy` frees the memory,
    which is MKL's own.

    Parameters
    ----------
    matrix
        (n, n) sparse matrix with both triangles, of which the upper one is read; no diagonal entry
        may be missing.
    definite
        Whether it is positive definite, which spares the pivoting.
    threads
        Threads of MKL, of this process from now on.
    """

    def __init__(self, matrix: sp.csr_matrix, definite: bool, threads: int = 1) -> None:
        import pypardiso

        self._type = DEFINITE if definite else INDEFINITE
        wrapper = pypardiso.PyPardisoSolver(mtype=self._type)
        # pypardiso numbers rows anew in every call and copies solutions: its call is made here.
        self._call = wrapper.libmkl.pardiso
        wrapper.libmkl.MKL_Set_Dynamic(0)
        wrapper.libmkl.MKL_Set_Num_Threads(threads)
        upper = sp.triu(matrix, format="csr")
        upper.sort_indices()
        self._values = np.ascontiguousarray(upper.data, dtype=np.float64)
        self._first = (upper.indptr + 1).astype(np.int32)
        self._columns = (upper.indices + 1).astype(np.int32)
        self._handle = np.zeros(64, dtype=np.int64)
        self._parameters = np.zeros(64, dtype=np.int32)
        for number, value in (_SETTINGS | ({} if definite else _PIVOTING)).items():
            self._parameters[number - 1] = value
        self._analysed = False

    def analyse(self) -> None:
        """Order the unknowns and find the pattern of the factor."""
        self._analysed = True
        self._run(_ANALYSE)

    def factorise(self) -> None:
        """Factorise; the analysis comes first."""
        self._run(_FACTORISE)
        self.entries = int(self._parameters[_ENTRIES - 1])

    @property
    def operations(self) -> float:
        """Floating-point operations of a factorisation, by an analysis of its own."""
        kept = self._handle, self._parameters
        self._handle, self._parameters = np.zeros_like(kept[0]), kept[1].copy()
        self._parameters[_LEVELS - 1], self._parameters[_MEGAFLOP - 1] = _CLASSIC, -1
        try:
            self._run(_ANALYSE)
            counted = 1e6 * float(self._parameters[_MEGAFLOP - 1])
            self._run(_RELEASE)
        finally:
            self._handle, self._parameters = kept
        return counted

    def solve(self, block: Array) -> Array:
        """Solution (n,) or column-major (n, k) for right-hand sides of that shape."""
        block = np.asfortranarray(block)
        solution = np.empty_like(block)
        self._run(_SOLVE, block, solution)
        return solution

    def destroy(self) -> None:
        """Free all memory of the factorisation."""
        if self._analysed:
            self._run(_RELEASE)

    def _run(self, phase: int, rhs: Array | None = None, solution: Array | None = None) -> None:
        def number(value: int) -> Any:
            return ctypes.byref(ctypes.c_int32(value))

        def place(array: Array | None) -> Any:
            return None if array is None else array.ctypes.data_as(ctypes.c_void_p)

        def numbers(array: Integers) -> Any:
            return array.ctypes.data_as(ctypes.POINTER(ctypes.c_int32))

        columns = rhs.shape[1] if rhs is not None and rhs.ndim == 2 else 1
        error = ctypes.c_int32(0)
        self._call(
            self._handle.ctypes.data_as(ctypes.POINTER(ctypes.c_int64)),
            number(1),
            number(1),
            number(self._type),
            number(phase),
            number(len(self._first) - 1),
            place(self._values),
            numbers(self._first),
            numbers(self._columns),
            None,
            number(columns),
            numbers(self._parameters),
            number(0),
            place(rhs),
            place(solution),
            ctypes.byref(error),
        )
        if error.value:
            raise ConvergenceError(f"PARDISO: error {error.value} in phase {phase}")
