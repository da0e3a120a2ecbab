"""Ground truth by SLEPc: shift-and-invert Krylov-Schur or ARPACK, with proof of completeness."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from carillon.errors import ConvergenceError
from solver.correction import SHIFT_FRACTION, rayleigh_ritz
from solver.eigensolver import smallest_eigenpairs
from solver.system import System

Array = NDArray[np.float64]

SPARE_MODES = 8
"""Modes computed beyond those asked for, so that the inertia count finds a gap to look through."""
POLYNOMIAL_DEGREE = 3


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


def first_elastic_estimate(system: System, nodes: Array) -> float:
    """Upper bound [rad^2/s^2] of the first elastic eigenvalue, from polynomial displacement fields.

    Parameters
    ----------
    nodes
        (n, 3) coordinates [m] in mesh order.
    """
    centred = nodes - nodes.mean(axis=0)
    centred = centred / np.abs(centred).max()
    powers = [
        (a, b, c)
        for a in range(POLYNOMIAL_DEGREE + 1)
        for b in range(POLYNOMIAL_DEGREE + 1 - a)
        for c in range(POLYNOMIAL_DEGREE + 1 - a - b)
    ]
    fields = np.stack([(centred**power).prod(axis=1) for power in powers], axis=1)
    block = np.einsum("np,ij->nipj", fields, np.eye(3)).reshape(3 * len(nodes), -1)
    values, _ = rayleigh_ritz(system, system.local_rows(block))
    return float(values[0])


def solve_truth(
    system: System, nodes: Array, modes: int, method: str = "slepc", tolerance: float = 1e-10
) -> Truth:
    """Compute the `modes` lowest eigenpairs of the assembled system, rigid modes included.

    Parameters
    ----------
    method
        `slepc` (Krylov-Schur) or `arpack`, both in shift-and-invert mode.
    tolerance
        Relative residual tolerance of the eigensolver.

    Raises
    ------
    ConvergenceError
        If too few pairs converge.
    """
    shift = SHIFT_FRACTION * first_elastic_estimate(system, nodes)
    wanted = min(modes + SPARE_MODES, system.n_dofs)
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
    """Number of eigenvalues below `value` [rad^2/s^2], by Sylvester's law of inertia and MUMPS."""
    shifted = system.K.copy()
    shifted.axpy(-value, system.M, structure=PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
    shifted.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    factorisation = PETSc.PC().create(system.comm)
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
