"""The elements that are analysed, whose moduli follow from those of the fine cells."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carillon.fem.geometry import HexMesh, blocks_from_mesh
from carillon.fem.model import Constants, fine_model
from carillon.fem.moduli import at_points
from solver.analysis.problem import ProblemOptions
from solver.coarsening.model import block_moduli, coarse_model

Array = NDArray[np.float64]


class AnalysedElements:
    """Fine cells, or the blocks that a coarsening makes of them.

    Parameters
    ----------
    mesh
        Fine mesh.
    options
        The solid, of which constants, coarsening and forests are used.

    Attributes
    ----------
    model
        The solid that is analysed, with moduli of 1 Pa.
    """

    def __init__(self, mesh: HexMesh, options: ProblemOptions) -> None:
        constants: Constants = {"poisson": options.poisson, "density": options.density}
        self._coarsening = options.coarsening()
        if self._coarsening is None:
            self.model = fine_model(mesh, np.ones(mesh.n_cells), **constants)
            return
        self._blocks = blocks_from_mesh(mesh)
        ones = np.ones((self._blocks.coarse.n_cells, 8))
        fraction = self._coarsening.lumped_fraction
        self.model = coarse_model(self._blocks, ones, fraction, **constants)

    def moduli(self, young: Array) -> Array:
        """Moduli (c, 8) [Pa] at the quadrature points from those (M,) [Pa] of the fine cells."""
        if self._coarsening is None:
            return at_points(young)
        return self._coarsening.moduli(block_moduli(self._blocks, young))

    def slopes(self, young: Array, directions: Array) -> Array:
        """Derivatives (8 c, m) of `moduli` along `directions` (M, m) of the fine moduli.

        Raises
        ------
        UserError
            If the coarsening has no derivatives.
        """
        if self._coarsening is None:
            return np.repeat(directions, 8, axis=0)
        blocks = self._blocks
        _, rows = self._coarsening.moduli_with_derivatives(block_moduli(blocks, young))
        inside = np.where(blocks.mask[:, :, None], directions[blocks.fine_of_block], 0.0)
        return np.asarray((rows @ inside).reshape(-1, directions.shape[1]))
