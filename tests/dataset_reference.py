"""The fits in plain numpy, one block at a time, with dense matrices (test support)."""

from functools import cache

import numpy as np

from carillon.fem.block import cell_stiffness
from carillon.fem.element import Array
from dataset_gen.objectives import chen2015, inertial, oversampled
from dataset_gen.objectives.patterns import (
    corner_strains,
    pattern_of,
    straining_motions,
)
from dataset_gen.objectives.quadratic import NormalEquations


def mask_of(young: Array) -> int:
    return int((young > 0) @ (1 << np.arange(8)))


def stiffness(young: Array, poisson: float) -> Array:
    """K(e) on the active nodes."""
    dofs = pattern_of(mask_of(young), poisson).dofs
    return np.einsum("j,jab->ab", young, cell_stiffness(poisson))[np.ix_(dofs, dofs)]


def flexibility(young: Array, poisson: float) -> Array:
    """K(e)^+ on the active nodes."""
    return np.linalg.pinv(stiffness(young, poisson), rcond=1e-11, hermitian=True)


def mismatch_equations(motions: Array, energies: Array, poisson: float) -> NormalEquations:
    """Normal equations of `2 |D|_F^2 + tr(D)^2`, D = sum_q E_q u^T K_q u - V, term by term."""
    strains = corner_strains(poisson).reshape(8, 6, 24) @ motions
    forms = [*(strains.transpose(0, 2, 1) @ strains), energies]
    gram = np.array([[2 * (a * b).sum() + np.trace(a) * np.trace(b) for a in forms] for b in forms])
    return NormalEquations(gram[:8, :8], gram[8, :8], gram[8, 8])


def inertial_equations(young: Array, poisson: float) -> NormalEquations:
    pattern = pattern_of(mask_of(young), poisson)
    loads = inertial.inertia_loads(mask_of(young), poisson)
    displacements = flexibility(young, poisson) @ loads
    motions = pattern.to_corners @ displacements
    return mismatch_equations(motions, loads.T @ displacements, poisson)


def oversampled_equations(young: Array, poisson: float) -> NormalEquations:
    pattern = pattern_of(mask_of(young), poisson)
    octants, loads = oversampled.octants(poisson)
    held = np.einsum("j,jab->ab", young, octants)[np.ix_(pattern.dofs, pattern.dofs)]
    fields = np.linalg.solve(held, np.einsum("j,jab->ab", young, loads)[pattern.dofs])
    energies = fields.T @ stiffness(young, poisson) @ fields
    share = oversampled.RIGID_SHARE * np.trace(energies)
    factor = np.linalg.inv(np.linalg.cholesky(energies + share * np.eye(len(energies))))
    motions = pattern.to_corners @ fields @ factor.T
    return mismatch_equations(motions, factor @ energies @ factor.T, poisson)


def chen2015_equations(young: Array, poisson: float) -> NormalEquations:
    flexible = flexibility(young, poisson)
    selection = chen2015.corner_selection(mask_of(young), poisson)
    return mismatch_equations(selection @ flexible, flexible, poisson)


EQUATIONS = {
    "inertial": inertial_equations,
    "oversampled": oversampled_equations,
    "chen2015": chen2015_equations,
}


@cache
def _coarse_fields(mask: int, poisson: float) -> tuple[Array, Array]:
    """What nodal forces feel of the corners' straining motions, and those motions' strains."""
    pattern, motions = pattern_of(mask, poisson), straining_motions()
    return pattern.without_null(pattern.interpolation @ motions), corner_strains(poisson) @ motions


def coarse_flexibility(moduli: Array, mask: int, poisson: float) -> Array:
    """P K_c(E)^+ P^T on self-equilibrated forces on the active nodes."""
    fields, strains = _coarse_fields(mask, poisson)
    return fields @ np.linalg.solve(strains.T @ (np.repeat(moduli, 6)[:, None] * strains), fields.T)


def expected_mismatch(moduli: Array, young: Array, poisson: float) -> tuple[float, float]:
    """Mean square of Eq. (8) over Gaussian forces, and of the fine energies."""
    fine = flexibility(young, poisson)
    coarse = coarse_flexibility(moduli, mask_of(young), poisson)
    means = [2 * (a * a).sum() + np.trace(a) ** 2 for a in (coarse - fine, fine)]
    return means[0], means[1]


def energy_differences(moduli: Array, young: Array, forces: Array, poisson: float) -> Array:
    """Coarse less fine energy (m,) under self-equilibrated forces (a, m)."""
    difference = coarse_flexibility(moduli, mask_of(young), poisson) - flexibility(young, poisson)
    return np.asarray((forces * (difference @ forces)).sum(axis=0))
