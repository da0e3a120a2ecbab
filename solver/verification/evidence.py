"""Evidence that a modes file holds, measured anew from the file alone.

K and M are assembled again from the mesh and the moduli in the file, by other code than that of the
run that wrote it; nothing that the run said about itself is used.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from carillon.arrays import Array
from carillon.fem.model import RIGID_MODES
from carillon.processes.mpi import MPI
from solver.assembly.sparse import assembled
from solver.assembly.system import assemble
from solver.distribution.local_mesh import distribute
from solver.files.modes_file import ModesFile
from solver.subspace.rayleigh_ritz import first_elastic_estimate
from solver.verification.factored import Factored, factored
from solver.verification.residuals import (
    COLUMNS_AT_ONCE,
    count_rigid,
    recomputed_residuals,
    residual_scale,
)

GAP, GAP_OF_TOLERANCE = 1e-4, 40.0
"""Relative width of a gap in which inaccurate eigenvalues cannot be mistaken for others, and the
same as a multiple of the tolerance that they were computed to."""
NEGLIGIBLE, FEWEST_SOLVED = 1e-8, 8
"""Residual ratio below which a residual is not measured in energy, but for the largest few."""


@dataclass(frozen=True)
class ModesEvidence:
    """How far the modes of a file are from eigenpairs, and whether any are missing."""

    modes: int
    unknowns: int
    """Number of modes and of unknowns."""
    residual_max: float
    residual_median: float
    """Largest and median of the residual ratios, see
    `solver.verification.residuals.residual_ratios`."""
    energy_residuals: list[float]
    """(k,) residuals r = K x - lambda M x in energy: the root of r^T (K + s M)^-1 r / lambda, where
    s is the last eigenvalue; lambda of rigid modes is the first elastic one.  Its square is of the
    order of the eigenvalue's relative error.  Where the residual ratio is below `NEGLIGIBLE`, that
    ratio."""
    rounding: list[float]
    """(k,) by how much each eigenvalue changes, relatively, if every product with an entry of K is
    rounded once: the unit roundoff times `|x|^T |K| |x| / lambda`."""
    quotient_errors: list[float]
    """(k,) relative difference of each eigenvalue from the Rayleigh quotient of its mode; 0 of
    rigid ones."""
    orthogonality: float
    """Largest entry of `|X^T M X - I|`."""
    rigid_modes: int
    """Number of eigenvalues that are zero to rounding."""
    counted_below: float
    counted: int | None
    expected: int
    """A value [rad^2/s^2], the number of eigenvalues below it by the inertia of K - value M, and
    the number that the file holds; None where PETSc cannot count."""
    mass: float
    """Mass of the solid [kg]."""


def measure_evidence(file: ModesFile, tolerance: float) -> ModesEvidence:
    """Measure the evidence in a modes file, whose eigenvalues were computed to a `tolerance`.

    Raises ArithmeticError if residuals or products of the modes are not finite.
    """
    assert file.modes is not None
    values, modes = file.eigenvalues, file.modes
    K, M = assembled(file.model)
    factors = factored(file.model, K, M)
    rigid = file.model.rigid_modes
    with np.errstate(all="ignore"):  # judged below
        residuals = recomputed_residuals(K, M, values, modes, rigid)
        gram = modes.T @ (M @ modes)
    if not (np.isfinite(residuals).all() and np.isfinite(gram).all()):
        raise ArithmeticError("residuals or products of the modes are not finite numbers")
    value, expected = gap_below_last(values, max(GAP, GAP_OF_TOLERANCE * tolerance), rigid)
    return ModesEvidence(
        len(values),
        file.model.n_dofs,
        float(residuals.max()),
        float(np.median(residuals)),
        _energy_residuals(K, M, factors, values, modes, residuals, rigid).tolist(),
        _rounding(K, values, modes, rigid).tolist(),
        _quotient_errors(K, values, modes, gram, rigid).tolist(),
        float(np.abs(gram - np.eye(len(gram))).max()),
        _count_rigid(file, K),
        value,
        factors.count_below(value),
        expected,
        file.model.mass,
    )


def _energy_residuals(
    K: sp.csr_matrix,
    M: sp.csr_matrix,
    factors: Factored,
    values: Array,
    modes: Array,
    ratios: Array,
    rigid: int,
) -> Array:
    result = ratios.copy()
    largest = np.argsort(ratios)[-FEWEST_SOLVED:]
    columns = np.union1d(np.flatnonzero(ratios > NEGLIGIBLE), largest)
    scale = residual_scale(values, rigid)
    with factors.inverse(values[-1]) as solve:
        for start in range(0, len(columns), COLUMNS_AT_ONCE):
            few = columns[start : start + COLUMNS_AT_ONCE]
            chosen = modes[:, few]
            residual = K @ chosen - (M @ chosen) * values[few]
            square = np.einsum("ij,ij->j", residual, solve(residual))
            result[few] = np.sqrt(np.maximum(square, 0.0) / scale[few])
    return result


def _quotient_errors(
    K: sp.csr_matrix, values: Array, modes: Array, gram: Array, rigid: int
) -> Array:
    elastic = slice(rigid, None)
    modes = modes[:, elastic]
    errors = np.zeros(len(values))
    quotients = np.einsum("ik,ik->k", modes, K @ modes) / np.diag(gram)[elastic]
    errors[elastic] = np.abs(values[elastic] / quotients - 1.0)
    return errors


def _rounding(K: sp.csr_matrix, values: Array, modes: Array, rigid: int) -> Array:
    size, weight = abs(K), np.empty(len(values))
    for start in range(0, len(weight), COLUMNS_AT_ONCE):
        few = slice(start, start + COLUMNS_AT_ONCE)
        part = np.abs(modes[:, few])
        weight[few] = np.einsum("ij,ij->j", part, size @ part)
    return np.asarray(np.finfo(float).eps * weight / residual_scale(values, rigid))


def _count_rigid(file: ModesFile, K: sp.csr_matrix) -> int:
    assert file.modes is not None
    scales = np.einsum("ij,i,ij->j", file.modes, K.diagonal(), file.modes)

    def estimate() -> float:
        alone = MPI.COMM_SELF
        return first_elastic_estimate(assemble(distribute(file.model, 1, comm=alone), alone))

    return count_rigid(file.eigenvalues, scales, estimate)


def gap_below_last(values: Array, gap: float = GAP, rigid: int = RIGID_MODES) -> tuple[float, int]:
    """Middle of the last gap between ascending values that is wide, rigid motions being at zero.

    Returns the value in the gap, and how many of the `values` are below it. Of equal modes at the
    end, more may come behind them: the gap is before these.

    Examples
    --------
    >>> gap_below_last(np.array([0.0] * 6 + [1.0, 2.0, 5.0, 5.00001]))
    (3.5, 8)
    >>> gap_below_last(np.array([0.0] * 6 + [1.0, 1.0]))
    (0.5, 6)
    """
    if len(values) <= rigid:
        return float(values[-1] * (1.0 + 1e-6)), len(values)
    elastic = values[rigid:]
    before = np.concatenate([[0.0], elastic[:-1]])
    wide = np.flatnonzero(elastic - before > gap * elastic)
    last = int(wide[-1]) if len(wide) else 0
    return float(0.5 * (before[last] + elastic[last])), rigid + last
