"""Checks of the linear solvers on any number of ranks: `tests/inner_checks.py NAME[,NAME]`.

Every rank makes the same checks, and one that fails ends them all.
"""

import sys

import numpy as np
import pytest
import scipy.sparse.linalg as spla
from mpi4py import MPI

from carillon.errors import ConvergenceError
from carillon.fem.model import ElasticModel
from carillon.processes.petsc import PETSc
from solver.assembly.sparse import assembled
from solver.assembly.system import System, assemble
from solver.distribution.local_mesh import distribute
from solver.linear.block_rows import block_rows, diagonal
from solver.linear.iterative import METHODS, IterativeInverse
from solver.linear.multigrid import Multigrid
from solver.subspace.rayleigh_ritz import safe_shift
from tests import solids

COMM = MPI.COMM_WORLD
PARTS = 8
THREADS = 2 if COMM.size == 1 else 1


def system_of(model: ElasticModel) -> System:
    """The model, which only the first rank looks at, on all ranks."""
    return assemble(distribute(model if COMM.rank == 0 else None, PARTS, comm=COMM), COMM)


def right_hand_sides(system: System, columns: int) -> np.ndarray:
    """Random loads, the same on any number of ranks; one holds nothing but a rigid motion."""
    block = np.random.default_rng(7).standard_normal((system.n_dofs, columns))
    rhs = solids.local_rows(system, block)
    rhs[:, 1:2] = system.times_mass(np.ascontiguousarray(system.rigid[:, 2:3]))
    rhs[:, 2] = 0.0
    return rhs


def relative_residuals(
    system: System, inverse: IterativeInverse, rhs: np.ndarray, solution: np.ndarray
) -> np.ndarray:
    image = system.times_stiffness(solution) - inverse.shift * system.times_mass(solution)
    left = system.column_products(rhs - image, rhs - image)
    scale = system.column_products(rhs, rhs)
    return np.sqrt(np.divide(left, scale, out=left, where=scale > 0.0))


def solutions_are_those_of_a_direct_solve() -> None:
    model = solids.random_box(9, 6, 5)
    system = system_of(model)
    shift = -safe_shift(system)
    rhs = right_hand_sides(system, 7)
    whole = system.gather(rhs)
    if COMM.rank == 0:
        K, M = assembled(model)
        expected = spla.splu((K - shift * M).tocsc()).solve(np.ascontiguousarray(whole))
    for method in METHODS:
        for tolerance in (1e-2, 1e-9):
            inverse = IterativeInverse(system, shift, method, tolerance, threads=THREADS)
            solution = inverse.solve(rhs)
            assert solution.flags.c_contiguous
            assert relative_residuals(system, inverse, rhs, solution).max() <= 1.01 * tolerance
            assert not solution[:, 2].any()
            found = system.gather(solution)
            inverse.destroy()
        if COMM.rank == 0:
            # The residual bounds it by the condition number, 1e5; what is left is far smaller.
            distance = np.linalg.norm(found - expected, axis=0)
            assert (distance <= 1e-7 * np.linalg.norm(expected, axis=0)).all()


def columns_are_solved_each_on_its_own() -> None:
    system = system_of(solids.random_box(7, 5, 4))
    rhs = right_hand_sides(system, 4)
    for method in METHODS:
        together = IterativeInverse(system, -safe_shift(system), method, 1e-5)
        one_by_one = IterativeInverse(system, -safe_shift(system), method, 1e-5, columns=1)
        solution, other = together.solve(rhs), one_by_one.solve(rhs)
        assert np.abs(solution - other).max() < 1e-4 * np.abs(solution).max()
        # Converged columns cost nothing more; rounding may move the last step.
        assert abs(together.iterations - one_by_one.iterations) <= 4
        together.destroy()
        one_by_one.destroy()


def rows_multiply_as_the_matrix_does() -> None:
    system = system_of(solids.random_box(6, 5, 4))
    block = right_hand_sides(system, 5)
    rows = block_rows(system.K, COMM, threads=THREADS)
    expected = system.times_stiffness(block)
    assert np.abs(rows.times(block) - expected).max() < 1e-12 * np.abs(expected).max()
    first, _ = system.K.getOwnershipRange()
    expected = system.K.getDiagonal().getArray()
    assert len(expected) == 3 * (system.stop - system.start) and first == 3 * system.start
    assert (diagonal(rows) == expected).all()


def multigrid_is_symmetric_positive_definite() -> None:
    system = system_of(solids.random_box(16, 9, 8))
    rhs = solids.local_rows(system, np.random.default_rng(0).standard_normal((system.n_dofs, 12)))
    for finest in (None, system.rows.stiffness_products):
        matrix = system.K.copy()
        same = PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN
        matrix.axpy(safe_shift(system), system.M, structure=same)
        holder = PETSc.PC().create(COMM)
        holder.setOperators(matrix)
        references = matrix.getRefCount()
        grid = Multigrid(matrix, system.rigid, COMM, finest)
        other, _ = holder.getOperators()
        assert other.getRefCount() == references + 1  # of `other` and `_`, less the matrix's own
        holder.destroy()
        assert len(grid.sizes) > 1 and grid.sizes[-1] == system.n_dofs
        gram = system.inner(rhs, grid.apply(rhs))
        assert np.abs(gram - gram.T).max() < 1e-12 * np.abs(gram).max()
        assert np.linalg.eigvalsh(gram)[0] > 0.0
        # A column is the same beside fewer than fill a register.
        few = grid.apply(np.ascontiguousarray(rhs[:, :2]))
        assert np.abs(few - grid.apply(rhs)[:, :2]).max() < 1e-12 * np.abs(few).max()
        grid.destroy()


def failure_is_everyones() -> None:
    system = system_of(solids.random_box(7, 5, 4))
    for method in METHODS:
        inverse = IterativeInverse(system, -safe_shift(system), method, 1e-8, max_iterations=2)
        message = f"{method}.*after 2 iterations, 1.0e-08 was asked"
        with pytest.raises(ConvergenceError, match=message):
            inverse.solve(right_hand_sides(system, 5))
        inverse.destroy()
    # Nothing is left under way.
    assert system.inner(system.rigid, system.times_mass(system.rigid)).shape == (6, 6)


if __name__ == "__main__":
    for name in sys.argv[1].split(","):
        globals()[name]()
