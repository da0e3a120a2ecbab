"""Ground truth by SLEPc: shift-and-invert Krylov-Schur or ARPACK, with proof of completeness."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from carillon.errors import ConvergenceError
from solver.eigensolver import smallest_eigenpairs
from solver.rayleigh_ritz import safe_shift
from solver.system import System

Array = NDArray[np.float64]

RESIDUAL_TOLERANCE = 1e-10
"""Relative residual of ground truth unless told otherwise."""
SPARE_MODES = 8
"""Modes computed beyond those asked for, so that the inertia count finds a gap to look through."""


@dataclass
class Truth:
    """Eigenpairs from a general solver.

    Attributes
    ----------
    values, vectors
        (k,) and (local, k), rigid modes included, k = `modes` and a few to spare.
    modes
        Number of modes asked for.
    iterations
        Outer iterations of the eigensolver.
    """

    values: Array
    vectors: Array
    modes: int
    iterations: int


@dataclass
class Inertia:
    """Number of eigenvalues below `value` [rad^2/s^2]: counted by a factorisation, and computed."""

    value: float
    counted: int
    computed: int


def solve_truth(
    system: System,
    modes: int,
    method: str = "slepc",
    tolerance: float = RESIDUAL_TOLERANCE,
    spare: int = SPARE_MODES,
) -> Truth:
    """Compute the `modes` lowest eigenpairs of the assembled system, rigid modes included.

    Parameters
    ----------
    method
        `slepc` (Krylov-Schur) or `arpack`, both in shift-and-invert mode.
    tolerance
        Relative residual tolerance of the eigensolver.
    spare
        Modes beyond, among which `prove_complete` looks for a gap.

    Raises
    ------
    ConvergenceError
        If too few pairs converge.
    """
    shift = safe_shift(system)
    wanted = min(modes + spare, system.n_dofs)
    values, vectors, iterations = smallest_eigenpairs(
        system.K, system.M, wanted, shift, tolerance, method
    )
    if len(values) < modes:
        raise ConvergenceError(
            f"{method} converged {len(values)} of {modes} modes to {tolerance:.0e} in {iterations} "
            "iterations"
        )
    return Truth(values, vectors, modes, iterations)


def can_count() -> bool:
    """Whether this PETSc can count eigenvalues by inertia, for which it needs MUMPS."""
    return bool(PETSc.Sys.hasExternalPackage("mumps"))


def prove_complete(system: System, truth: Truth) -> Inertia:
    """Check by the inertia of K - mu M that no eigenvalue below the last wanted one was missed.

    The shift mu lies in the widest gap among the spare modes.

    Raises
    ------
    ConvergenceError
        If the count contradicts the computed number.
    """
    value, computed = _gap(truth.values, truth.modes)
    counted = count_below(system, value)
    if counted != computed:
        raise ConvergenceError(
            f"the solver found {computed} eigenvalues below {value:.6g} rad^2/s^2, the inertia "
            f"of K - mu M counts {counted}: eigenvalues were missed"
        )
    return Inertia(value, counted, computed)


def _gap(values: Array, modes: int) -> tuple[float, int]:
    """Middle of the widest relative gap after the last wanted value, and the count below it."""
    if len(values) <= modes:
        return float(values[-1] * (1.0 + 1e-6)), len(values)
    gaps = np.diff(values[modes - 1 :]) / values[modes:]
    widest = int(np.argmax(gaps)) + modes
    return float(0.5 * (values[widest - 1] + values[widest])), widest


def count_below(system: System, value: float) -> int:
    """Number of eigenvalues of an assembled system below `value` [rad^2/s^2]."""
    return count_negative(system.K, system.M, value)


def count_negative(K: PETSc.Mat, M: PETSc.Mat, value: float) -> int:
    """Negative eigenvalues of K - value M, by Sylvester's law of inertia and MUMPS."""
    shifted = K.copy()
    shifted.axpy(-value, M, structure=PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
    shifted.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    factorisation = PETSc.PC().create(K.comm)
    factorisation.setOperators(shifted)
    factorisation.setType(PETSc.PC.Type.CHOLESKY)
    factorisation.setFactorSolverType("mumps")
    factorisation.setFactorSetUpSolverType()
    # Inertia needs the root of the elimination tree on one rank, and its null pivots detected.
    factor = factorisation.getFactorMatrix()
    factor.setMumpsIcntl(13, 1)
    factor.setMumpsIcntl(24, 1)
    factorisation.setUp()
    negative, _, _ = factorisation.getFactorMatrix().getInertia()
    factorisation.destroy()
    shifted.destroy()
    return int(negative)
