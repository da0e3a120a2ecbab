"""Where the strain energy of vibrating solids sits, element by element."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from carillon.fem.block import degrees_of_freedom
from carillon.fem.element import uniform_stiffness
from carillon.fem.geometry import Blocks
from carillon.fem.model import ElasticModel

Array = NDArray[np.float64]

NUMBERS_AT_ONCE = 1 << 22
"""Number of element displacements that exist at once."""


def element_energies(model: ElasticModel, vectors: Array) -> Array:
    """Twice the strain energy (m, k) [J] of each element in displacements (n_dofs, k) [m]."""
    dofs = degrees_of_freedom(model.mesh.cells.astype(np.int64))
    energies = np.empty((len(dofs), vectors.shape[1]))
    uniform = model.mesh.kinds is None and bool((model.young == model.young[:, :1]).all())
    kernel = uniform_stiffness(model.poisson)
    for chosen in _chunks(len(dofs), 24 * (24 + vectors.shape[1])):
        motions = vectors[dofs[chosen]]
        if uniform:
            scale = model.mesh.edge * model.young[chosen, 0]
            energies[chosen] = (motions * (kernel @ motions)).sum(axis=1) * scale[:, None]
        else:
            energies[chosen] = (motions * (model.stiffness(chosen) @ motions)).sum(axis=1)
    return energies


def fine_energies(blocks: Blocks, fine: ElasticModel, vectors: Array) -> Array:
    """The same of the fine cells that each element of a coarse mesh holds, (mc, k)."""
    energies = element_energies(fine, vectors)
    element, position = np.nonzero(blocks.mask)
    cells = blocks.fine_of_block[element, position]
    start = np.flatnonzero(np.diff(element, prepend=-1))
    return np.asarray(np.add.reduceat(energies[cells], start, axis=0))


def _chunks(count: int, numbers: int) -> Iterator[slice]:
    step = max(1, NUMBERS_AT_ONCE // numbers)
    for first in range(0, count, step):
        yield slice(first, min(first + step, count))
