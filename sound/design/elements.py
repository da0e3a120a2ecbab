"""Elements of the analysed solid, as functions of the moduli of its voxels."""

from abc import ABC, abstractmethod
from functools import partial
from typing import Any

import numpy as np

from carillon.arrays import Array
from carillon.fem.element import quadrature_stiffness
from carillon.fem.finite_cells.cells import FiniteCells
from carillon.fem.finite_cells.model import finite_cell_model
from carillon.fem.finite_cells.shapes import strain_factors
from carillon.fem.geometry import HexMesh, blocks_from_mesh
from carillon.fem.model import Constants, Solid, fine_model
from carillon.fem.regions import Regions
from solver.analysis.modal_solver import ModalSolver
from solver.analysis.modes import Modes
from solver.analysis.problem import ProblemOptions
from solver.coarsening.coarsening import Coarsening
from solver.coarsening.model import block_moduli, coarse_model

STRAINS = 6
"""Rank of the stiffness at a quadrature point."""


class AnalysedElements(ABC):
    """Elements of a solid as functions of the moduli (M,) [Pa] of its voxels.

    `model` is the analysed solid with moduli of 1 Pa.
    """

    model: Solid

    def with_young(self, young: Array) -> Solid:
        """The solid with these moduli."""
        return self.model.with_young(young)

    def solve(self, solver: ModalSolver, young: Array, *how: Any) -> Modes:
        """Modes by a solver of `model`; `ModalSolver.solve` has the other parameters."""
        return solver.solve(young, *how)

    @abstractmethod
    def slopes(self, young: Array, directions: Array) -> Array:
        """Derivatives (p c, m) of the moduli at the p points of c elements.

        They are directional derivatives along m `directions` (M, m) of the voxels' moduli.  Raises
        UserError if the coarsening has no derivatives.
        """

    @abstractmethod
    def strains(self, poisson: float) -> Array:
        """Matrices B (p, 6, 3 k); the stiffness of modulus 1 at point p is B_p^T B_p."""


def analysed_elements(
    mesh: HexMesh, options: ProblemOptions, cells: FiniteCells | None = None
) -> AnalysedElements:
    """Elements of a solid by its options: finite cells with its voxels, voxels, or blocks of a
    coarsening.
    """
    constants: Constants = {"regions": Regions.one(options.poisson, options.density)}
    if cells is not None:
        return _CellElements(cells, constants)
    coarsening = options.coarsening()
    if coarsening is None:
        return _FineElements(mesh, constants)
    return _CoarseElements(mesh, coarsening, constants)


class _FineElements(AnalysedElements):
    """Voxels."""

    def __init__(self, mesh: HexMesh, constants: Constants) -> None:
        self.model = fine_model(mesh, np.ones(mesh.n_cells), **constants)

    def slopes(self, young: Array, directions: Array) -> Array:
        return np.repeat(directions, 8, axis=0)

    def strains(self, poisson: float) -> Array:
        values, vectors = np.linalg.eigh(quadrature_stiffness(poisson))
        factors = np.sqrt(np.maximum(values, 0.0))[:, None, :] * vectors
        factors = np.sqrt(self.model.mesh.edge) * factors[:, :, -STRAINS:]
        return np.ascontiguousarray(factors.transpose(0, 2, 1))


class _CoarseElements(_FineElements):
    """Blocks of voxels with moduli by a coarsening."""

    def __init__(self, mesh: HexMesh, coarsening: Coarsening, constants: Constants) -> None:
        self._coarsening, self._constants = coarsening, constants
        self._blocks = blocks_from_mesh(mesh)
        self.model = self._model(np.ones((self._blocks.coarse.n_cells, 8)))

    def _model(self, moduli: Array) -> Solid:
        fraction = self._coarsening.lumped_fraction
        return coarse_model(self._blocks, moduli, fraction, **self._constants)

    def _moduli(self, young: Array) -> Array:
        return self._coarsening.moduli(block_moduli(self._blocks, young))

    def with_young(self, young: Array) -> Solid:
        return self._model(self._moduli(young))

    def solve(self, solver: ModalSolver, young: Array, *how: Any) -> Modes:
        return partial(solver.solve, coarsened=True)(self._moduli(young), *how)

    def slopes(self, young: Array, directions: Array) -> Array:
        blocks = self._blocks
        _, rows = self._coarsening.moduli_with_derivatives(block_moduli(blocks, young))
        inside = np.where(blocks.mask[:, :, None], directions[blocks.fine_of_block], 0.0)
        return np.asarray((rows @ inside).reshape(-1, directions.shape[1]))


class _CellElements(AnalysedElements):
    """Finite cells, whose stiffness is linear in the voxels' moduli."""

    def __init__(self, cells: FiniteCells, constants: Constants) -> None:
        self._cells = cells
        ones = np.ones(cells.mesh.n_cells)
        self.model = finite_cell_model(cells, ones, constants["regions"])

    def slopes(self, young: Array, directions: Array) -> Array:
        columns = [self._cells.point_values(along).ravel() for along in directions.T]
        return np.stack(columns, axis=1)

    def strains(self, poisson: float) -> Array:
        return np.sqrt(2.0 * self.model.mesh.edge) * strain_factors(poisson)
