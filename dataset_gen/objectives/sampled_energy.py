"""Eq. (8) as it is printed: forces are drawn, both meshes are solved, energies are compared.

Kept to check `energy` and to measure what its closed form saves.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from dataset_gen.element import DEFAULT_POISSON, Array
from dataset_gen.objectives.energy import MODULUS_CEILING
from dataset_gen.objectives.patterns import corner_strains, pattern_of, straining_motions
from dataset_gen.objectives.quadratic import MODULUS_FLOOR, reference_moduli

DIRECTIONS = 1000
"""Force directions of one fit (section 8.1)."""

MAGNITUDES = (0.2, 0.4, 0.6, 0.8, 1.0)
"""Five magnitudes in each direction; they only rescale the energies."""


def draw_forces(young: Array, directions: int, generator: np.random.Generator) -> Array:
    """Self-equilibrated unit forces (a, directions) on the active nodes of the block `young` (8,).

    Multiplied by independent chi-distributed lengths they would be Gaussian.
    """
    pattern = pattern_of(_mask(young), DEFAULT_POISSON)
    gaussian = generator.standard_normal((len(pattern.dofs), directions))
    forces = pattern.without_null(gaussian)
    return np.asarray(forces / np.linalg.norm(forces, axis=0))


def _mask(young: Array) -> int:
    return int((young > 0) @ (1 << np.arange(8)))


def fine_energies(young: Array, forces: Array, poisson: float = DEFAULT_POISSON) -> Array:
    """Energies (m,) `f^T K(e)^+ f` of forces (a, m)."""
    pattern = pattern_of(_mask(young), poisson)
    displacements = np.linalg.solve(pattern.assemble(young[None])[0], forces)
    return np.asarray((forces * displacements).sum(axis=0))


def coarse_energies(moduli: Array, young: Array, forces: Array, poisson: float) -> Array:
    """Energies (m,) `(P^T f)^T K_c(E)^+ (P^T f)` of forces (a, m)."""
    motions = straining_motions()
    strains = corner_strains(poisson) @ motions
    interpolation = pattern_of(_mask(young), poisson).interpolation @ motions
    loads = interpolation.T @ forces
    weighted = np.repeat(moduli, 6)[:, None] * strains
    return np.asarray((loads * np.linalg.solve(strains.T @ weighted, loads)).sum(axis=0))


def fit_block(
    young: Array,
    generator: np.random.Generator,
    poisson: float = DEFAULT_POISSON,
    directions: int = DIRECTIONS,
    magnitudes: tuple[float, ...] = MAGNITUDES,
) -> Array:
    """Coarse moduli (8,) of the block `young` (8,) from sampled forces."""
    unit = draw_forces(young, directions, generator)
    forces = np.concatenate([size * unit for size in magnitudes], axis=1)
    energies = fine_energies(young, forces, poisson)
    largest = young.max()

    def mismatch(logs: Array) -> Array:
        coarse = coarse_energies(np.exp(logs), young, forces, poisson)
        return np.asarray((coarse - energies) * largest)

    start = np.log(reference_moduli(young[None])[0])
    bounds = np.log(largest * MODULUS_FLOOR), np.log(largest * MODULUS_CEILING)
    found = least_squares(mismatch, np.clip(start, *bounds), bounds=bounds, xtol=1e-6, ftol=1e-8)
    return np.asarray(np.exp(found.x))
