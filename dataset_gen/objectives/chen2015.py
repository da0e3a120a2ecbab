"""Objective `chen2015`: energies at the block's corner displacements (Chen et al. 2015).

The block is loaded by Gaussian forces in self-equilibrium on all active nodes; the coarse element
takes over the displacements of the corners and shall store the same energy. A void corner has no
displacement; it continues the trilinear motion nearest to the active nodes.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from dataset_gen.block import CORNER_NODES, degrees_of_freedom
from dataset_gen.element import Array
from dataset_gen.objectives.patterns import corner_strains, pattern_of
from dataset_gen.objectives.quadratic import NormalEquations, PatternFits, bounded_moduli

WEIGHT = 0.02
"""Pull towards the fine moduli, as a share of the mean diagonal of the normal matrix."""


@cache
def corner_selection(mask: int, poisson: float) -> Array:
    """Matrix (24, a) that reads the corners' displacements off the active nodes."""
    pattern = pattern_of(mask, poisson)
    selection = pattern.to_corners.copy()
    for row, dof in enumerate(degrees_of_freedom(CORNER_NODES)):
        found = np.flatnonzero(pattern.dofs == dof)
        if len(found):
            selection[row] = 0.0
            selection[row, found] = 1.0
    return selection


def fit_pattern(young: Array, mask: int, poisson: float) -> PatternFits:
    """Fit blocks (n, 8) that share one void pattern.

    With `C` the corner selection, the coarse energy form is `K^+ C^T K_q C K^+` and the fine one
    `K^+`; all products the closed form needs reduce to 24x24 matrices.
    """
    pattern = pattern_of(mask, poisson)
    null = pattern.null
    shift = young[:, pattern.cells].mean(axis=1)[:, None, None]
    inverse = np.linalg.inv(pattern.assemble(young)) - (null @ null.T) / shift
    flexible = corner_selection(mask, poisson) @ inverse
    scale = corner_strains(poisson)
    squared = scale @ (flexible @ flexible.transpose(0, 2, 1)) @ scale.T
    cubed = scale @ ((flexible @ inverse) @ flexible.transpose(0, 2, 1)) @ scale.T
    count = len(young)
    products = (squared * squared).reshape(count, 8, 6, 8, 6).sum(axis=(2, 4))
    traces = np.einsum("nii->ni", squared).reshape(count, 8, 6).sum(axis=2)
    loaded = np.einsum("nii->ni", cubed).reshape(count, 8, 6).sum(axis=2)
    trace = np.einsum("nii->n", inverse)
    equations = NormalEquations(
        2.0 * products + traces[:, :, None] * traces[:, None, :],
        2.0 * loaded + trace[:, None] * traces,
        2.0 * (inverse * inverse).sum(axis=(1, 2)) + trace**2,
    )
    return bounded_moduli(equations, young, young, WEIGHT)
