"""Elements of the analysed solid, as functions of the moduli of its voxels."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from carillon.arrays import Array, Index
from carillon.composition.composition import PlacedRegions
from carillon.errors import UserError
from carillon.fem.elasticity import Elasticity
from carillon.fem.element import matrix_of, quadrature_stiffness
from carillon.fem.finite_cells.cells import FiniteCells
from carillon.fem.finite_cells.hanging import node_weights
from carillon.fem.finite_cells.kinks import Borders
from carillon.fem.finite_cells.matrices import strain_factors
from carillon.fem.finite_cells.model import FiniteCellModel, finite_cell_model
from carillon.fem.geometry import HexMesh, blocks_from_mesh
from carillon.fem.model import ElasticModel, Solid, fine_model
from carillon.fem.regions import RegionOf, Regions
from carillon.fem.supports import Supports
from solver.analysis.modal_solver import ModalSolver
from solver.analysis.modes import Modes
from solver.analysis.problem import ProblemOptions
from solver.coarsening.coarsening import Coarsening
from solver.coarsening.model import block_moduli, coarse_model

STRAINS = 6
"""Rank of the stiffness at a quadrature point."""
Law = float | Elasticity
"""Poisson's ratio, or another elasticity."""


@dataclass(frozen=True)
class RegionElements:
    """Elements that hold some of a region: a row of the table, and which elements (r,)."""

    region: int
    cells: Index | slice
    kink: tuple[int, int] | None = None
    """Number and side of the kink of a cell that has one, see
    `carillon.fem.finite_cells.kinks.Kinks`."""


class AnalysedElements(ABC):
    """Elements of a solid as functions of the moduli (M,) [Pa] of its voxels.

    `model` is the analysed solid with moduli of 1 Pa, `parts` are its elements by region.
    """

    model: Solid
    parts: list[RegionElements]

    def with_young(self, young: Array) -> Solid:
        """The solid with these moduli."""
        return self.model.with_young(young)

    def solve(self, solver: ModalSolver, young: Array, *how: Any) -> Modes:
        """Modes by a solver of `model`; `ModalSolver.solve` has the other parameters."""
        return solver.solve(young, *how)

    @abstractmethod
    def slopes(self, young: Array, directions: Array) -> list[Array]:
        """Derivatives (p r, m) of the moduli at the p points of the r elements of each part.

        They are directional derivatives along m `directions` (M, m) of the voxels' moduli.  Raises
        UserError if the coarsening has no derivatives.
        """

    @abstractmethod
    def strains(self, part: RegionElements, law: Law) -> Array:
        """Matrices B (p, 6, 3 k) of a part; the stiffness of modulus 1 at point p is B_p^T B_p."""


def analysed_elements(
    mesh: HexMesh,
    options: ProblemOptions,
    cells: FiniteCells | None = None,
    placed: PlacedRegions | None = None,
    supports: Supports | None = None,
) -> AnalysedElements:
    """Elements of a solid by its options: finite cells with its voxels, voxels, or blocks of a
    coarsening.

    Its materials are `placed`, by default one by the options.  Raises UserError for what has no
    derivatives.
    """
    if placed is None:
        placed = PlacedRegions(Regions.one(options.poisson, options.density))
    if cells is not None:
        return _CellElements(cells, placed, supports)
    coarsening = coarsening_of(options, placed.regions)
    if coarsening is None:
        return _FineElements(mesh, placed, supports)
    return _CoarseElements(mesh, coarsening, placed, supports)


def coarsening_of(options: ProblemOptions, regions: Regions) -> Coarsening | None:
    """The coarsening of a search; None without.

    Raises UserError if it is not for all Poisson's ratios, or some region is anisotropic.
    """
    coarsening = options.coarsening(regions)
    if coarsening is not None and coarsening.general is not None and not regions.is_isotropic:
        wood = next(name for name, law in zip(regions.names, regions.laws) if law.poisson is None)
        raise UserError(
            f"region {wood!r} is not the same in all directions, and coarse elements of such have "
            "no derivatives; choose all voxels (coarsen: none) or discretisation: finite-cell"
        )
    return coarsening


class _FineElements(AnalysedElements):
    """Voxels."""

    model: ElasticModel

    def __init__(self, mesh: HexMesh, placed: PlacedRegions, supports: Supports | None) -> None:
        self.model = fine_model(
            mesh,
            np.ones(mesh.n_cells),
            placed.region,
            regions=placed.regions,
            supports=supports,
        )
        self.parts = _parts(self.model)

    def slopes(self, young: Array, directions: Array) -> list[Array]:
        return self._by_part(np.repeat(directions, 8, axis=0))

    def _by_part(self, slopes: Array) -> list[Array]:
        """Derivatives (8 c, m) by part: those of a point are of its own region."""
        region = self.model.region
        if region is None:
            return [slopes]
        by_cell = slopes.reshape(len(region), 8, -1)
        return [
            np.where(
                (region[part.cells] == part.region)[:, :, None], by_cell[part.cells], 0.0
            ).reshape(-1, slopes.shape[1])
            for part in self.parts
        ]

    def strains(self, part: RegionElements, law: Law) -> Array:
        values, vectors = np.linalg.eigh(quadrature_stiffness(law))
        factors = np.sqrt(np.maximum(values, 0.0))[:, None, :] * vectors
        factors = np.sqrt(self.model.mesh.edge) * factors[:, :, -STRAINS:]
        return np.ascontiguousarray(factors.transpose(0, 2, 1))


def _parts(model: ElasticModel) -> list[RegionElements]:
    region = model.region
    if region is None:
        return [RegionElements(0, slice(None))]
    return [
        RegionElements(int(number), np.flatnonzero((region == number).any(axis=1)))
        for number in np.unique(region)
    ]


class _CoarseElements(_FineElements):
    """Blocks of voxels with moduli by a coarsening."""

    def __init__(
        self,
        mesh: HexMesh,
        coarsening: Coarsening,
        placed: PlacedRegions,
        supports: Supports | None,
    ) -> None:
        self._coarsening, self._placed, self._supports = coarsening, placed, supports
        self._blocks = blocks_from_mesh(mesh)
        self.model = self._model(np.ones((self._blocks.coarse.n_cells, 8)))
        self.parts = _parts(self.model)

    def _model(self, moduli: Array) -> ElasticModel:
        return coarse_model(
            self._blocks,
            moduli,
            self._coarsening.lumped_fraction,
            self._placed.region,
            regions=self._placed.regions,
            supports=self._supports,
        )

    def _moduli(self, young: Array) -> Array:
        return self._coarsening.moduli(block_moduli(self._blocks, young))

    def with_young(self, young: Array) -> Solid:
        return self._model(self._moduli(young))

    def solve(self, solver: ModalSolver, young: Array, *how: Any) -> Modes:
        return partial(solver.solve, coarsened=True)(self._moduli(young), *how)

    def slopes(self, young: Array, directions: Array) -> list[Array]:
        blocks = self._blocks
        _, rows = self._coarsening.moduli_with_derivatives(block_moduli(blocks, young))
        inside = np.where(blocks.mask[:, :, None], directions[blocks.fine_of_block], 0.0)
        return self._by_part((rows @ inside).reshape(-1, directions.shape[1]))


class _CellElements(AnalysedElements):
    """Finite cells, whose stiffness is linear in the voxels' moduli."""

    model: FiniteCellModel

    def __init__(
        self, cells: FiniteCells, placed: PlacedRegions, supports: Supports | None
    ) -> None:
        ones = np.ones(cells.mesh.n_cells)
        self.model = finite_cell_model(
            cells, ones, placed.regions, placed.region, placed.shared, supports
        )
        elements = self.model.elements
        self._slots: list[Index] = []
        self.parts: list[RegionElements] = []
        law = elements.law
        if law is None:
            law = np.zeros((len(elements), 1), dtype=np.uint16)
        there = elements.shares.any(axis=2)
        if elements.kinks is not None:
            self._add_kinks(elements.kinks.borders, law)
            for part, slot in zip(self.parts, self._slots, strict=True):
                there[part.cells, slot] = False
        for number in np.unique(law):
            cell, slot = np.nonzero(there & (law == number))
            for kind in np.unique(elements.kinds[cell]):
                own = elements.kinds[cell] == kind
                self._slots.append(slot[own])
                self.parts.append(RegionElements(int(number), cell[own]))

    def _add_kinks(self, borders: Borders, law: RegionOf) -> None:
        """Add the two sides of each cell that has a kink, whose strains are its own."""
        for number, cell in enumerate(borders.cell):
            for side, region in enumerate(borders.region[number]):
                self._slots.append(np.flatnonzero(law[cell] == region)[:1])
                own = np.array([cell])
                self.parts.append(RegionElements(int(region), own, (number, side)))

    def slopes(self, young: Array, directions: Array) -> list[Array]:
        # The stiffness is linear in the moduli, so that directions are moduli, too.
        cells = self.model.cells
        count = directions.shape[1]
        found = [np.empty((cells.basis.n_points * len(slot), count)) for slot in self._slots]
        for column, along in enumerate(directions.T):
            moduli = self.model.linear_moduli(along) * cells.edges[:, None, None]
            for part, slot, own in zip(self.parts, self._slots, found, strict=True):
                own[:, column] = moduli[part.cells, slot].ravel()
        return found

    def strains(self, part: RegionElements, law: Law) -> Array:
        degree, elements = self.model.cells.degree, self.model.elements
        factors = strain_factors(degree, law)
        if part.kink is not None and elements.kinks is not None:
            root = np.linalg.cholesky(matrix_of(law)).T
            factors = root @ elements.kinks.whole_strains(*part.kink)
        kind = int(elements.kinds[part.cells][0])
        if kind:
            factors = factors @ np.kron(node_weights(degree, kind), np.eye(3))
        return np.asarray(factors)
