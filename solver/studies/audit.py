"""Evidence that a modes file holds, found anew from the file alone.

K and M are assembled again from the mesh and the moduli in the file, by other code than that of the
run that wrote it; nothing that the run said about itself is used.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI
from numpy.typing import NDArray

from carillon.errors import UserError
from carillon.fem.model import RIGID_MODES
from solver.assembly.petsc_matrix import distributed_matrix
from solver.assembly.sparse import assembled
from solver.files.modes_file import ModesFile, read_modes
from solver.reference.truth import can_count, count_negative
from solver.studies.comparison import recomputed_residuals
from solver.subspace.verification import count_rigid

Array = NDArray[np.float64]

LAST_MODES = 16
"""Modes before the last one among which a gap is looked for, to count below it."""
GAP = 1e-4
"""Relative width of a gap in which inaccurate eigenvalues cannot be mistaken for others."""


@dataclass(frozen=True)
class Audit:
    """What is found.

    Attributes
    ----------
    modes, unknowns
        Number of modes and of unknowns.
    residual_max, residual_median
        Of the residual ratios, see `solver.subspace.verification.residual_ratios`.
    orthogonality
        Largest entry of |X^T M X - I|.
    rigid_modes
        Number of eigenvalues that are zero to rounding.
    counted_below, counted, expected
        A value [rad^2/s^2], the number of eigenvalues below it by the inertia of K - value M, and
        the number that the file holds; None where PETSc cannot count.
    mass
        Of the solid [kg].
    """

    modes: int
    unknowns: int
    residual_max: float
    residual_median: float
    orthogonality: float
    rigid_modes: int
    counted_below: float
    counted: int | None
    expected: int
    mass: float

    def as_dict(self) -> dict[str, Any]:
        """Plain dictionary, ready for JSON."""
        return asdict(self)


def audit_files(paths: Iterable[str | Path]) -> dict[str, Audit]:
    """Audits of modes files by the stems of their names, or by the names where stems are equal.

    Raises
    ------
    UserError
        If a file is unusable, or its audit leaves the range of numbers.
    """
    names = list(dict.fromkeys(map(str, paths)))
    stems = [Path(path).stem for path in names]
    labels = stems if len(set(stems)) == len(stems) else names
    return {label: _audited(path) for label, path in zip(labels, names, strict=True)}


def _audited(path: str) -> Audit:
    try:
        return audit(read_modes(path))
    except ArithmeticError as error:
        raise UserError(f"{path}: {error}; compute the modes again") from None


def audit(file: ModesFile) -> Audit:
    """Audit the contents of a modes file.

    Raises
    ------
    ArithmeticError
        If what is found is no number, so that nothing can be said about the modes.
    """
    assert file.modes is not None
    K, M = assembled(file.model)
    with np.errstate(all="ignore"):  # judged below
        residuals = recomputed_residuals(file, K, M)
        gram = file.modes.T @ (M @ file.modes)
    if not (np.isfinite(residuals).all() and np.isfinite(gram).all()):
        raise ArithmeticError("residuals or products of the modes are not finite numbers")
    value, expected = gap_below_last(file.eigenvalues)
    return Audit(
        len(file.eigenvalues),
        file.mesh.n_dofs,
        float(residuals.max()),
        float(np.median(residuals)),
        float(np.abs(gram - np.eye(len(gram))).max()),
        count_rigid(file.eigenvalues),
        value,
        _count(K, M, value) if can_count() else None,
        expected,
        file.model.mass,
    )


def gap_below_last(values: Array) -> tuple[float, int]:
    """Middle of the last gap between ascending values that is wide, or else of the widest one.

    Returns
    -------
    tuple[float, int]
        The value in the gap, and how many of the `values` are below it.

    Examples
    --------
    >>> gap_below_last(np.array([0.0] * 6 + [1.0, 2.0, 5.0, 5.00001]))
    (3.5, 8)
    """
    if len(values) <= RIGID_MODES + 1:
        return float(values[-1] * (1.0 + 1e-6)), len(values)
    first = max(RIGID_MODES, len(values) - 1 - LAST_MODES)
    gaps = np.diff(values[first:]) / values[first + 1 :]
    wide = np.flatnonzero(gaps > GAP)
    below = first + 1 + int(wide[-1] if len(wide) else np.argmax(gaps))
    return float(0.5 * (values[below - 1] + values[below])), below


def _count(K: sp.csr_matrix, M: sp.csr_matrix, value: float) -> int:
    stiffness, mass = (distributed_matrix(part, MPI.COMM_SELF) for part in (K, M))
    try:
        return count_negative(stiffness, mass, value)
    finally:
        stiffness.destroy()
        mass.destroy()
