"""A solid of finite cells with material."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Flags, Index
from carillon.fem.block import NODES
from carillon.fem.element import DEFAULT_POISSON
from carillon.fem.elements import Chosen, Elements
from carillon.fem.finite_cells.cells import FiniteCells
from carillon.fem.finite_cells.hanging import at_nodes, node_places, node_weights
from carillon.fem.finite_cells.shapes import point_mass, point_stiffness, shape_functions
from carillon.fem.geometry import HexMesh
from carillon.fem.model import DEFAULT_DENSITY, Damping, Solid
from carillon.fem.moduli import require_moduli


@dataclass(frozen=True)
class CellElements(Elements):
    """Quadratic cells of twice the lattice's spacing, integrated over what of them is inside."""

    young: Array
    """(c, 125) moduli [Pa] times the points' weights, see `carillon.fem.finite_cells.shapes`."""
    share: Array
    """(c, 125) the same of the density over that of the solid."""
    edge: float
    """Step of the lattice [m]."""
    poisson: float
    density: float
    """See `Solid`."""
    span: NDArray[np.int32] | None = None
    kinds: Index | None = None
    """(c,) see `FiniteCells`, of cells of two sizes; else None."""

    def of(self, *arrays: NDArray[Any]) -> Self:
        young, share, *sizes = arrays
        span, kinds = sizes or (None, None)
        return replace(self, young=young, share=share, span=span, kinds=kinds)

    def arrays(self) -> list[NDArray[Any]]:
        if self.span is None or self.kinds is None:
            return [self.young, self.share]
        return [self.young, self.share, self.span, self.kinds]

    @property
    def steps(self) -> int:
        return 2 if self.span is None else 4

    @property
    def node_places(self) -> Index:
        if self.span is None or self.kinds is None:
            return np.broadcast_to(NODES, (len(self), *NODES.shape))
        return node_places(self.kinds) * (self.span // 2)[:, None, None]

    def _edges(self, chosen: Chosen) -> Array | float:
        """Edges [m] of the chosen cells, (c, 1) of cells of two sizes."""
        if self.span is None:
            return 2.0 * self.edge
        return self.edge * self.span[chosen][:, None].astype(float)

    def _between_nodes(self, matrices: Array, chosen: Chosen) -> Array:
        return matrices if self.kinds is None else at_nodes(matrices, self.kinds[chosen])

    @property
    def collinear(self) -> Flags:
        return np.ones(len(self), dtype=bool)  # there are three nodes on an edge

    @property
    def sort_key(self) -> Index:
        # None is needed: parts in one place have a node of their own in their middle.
        return np.zeros(len(self), dtype=np.int64)

    def stiffness(self, chosen: Chosen = slice(None)) -> Array:
        matrices = (self._edges(chosen) * self.young[chosen]) @ point_stiffness(self.poisson)
        return self._between_nodes(matrices.reshape(-1, 81, 81), chosen)

    def nodal_mass(self, chosen: Chosen = slice(None)) -> Array:
        scale = self.density * self._edges(chosen) ** 3
        matrices = (scale * self.share[chosen]) @ point_mass()
        return self._between_nodes(matrices.reshape(-1, 27, 27), chosen)


@dataclass(frozen=True)
class FiniteCellModel(Solid):
    """Finite cells with a modulus for every voxel that holds material."""

    cells: FiniteCells
    """The mesh."""
    young: Array
    """(m,) Young's modulus [Pa] of each voxel, taken as it is: what users give goes through
    `finite_cell_model` and `with_young`."""
    poisson: float = DEFAULT_POISSON
    density: float = DEFAULT_DENSITY
    damping: Damping | None = None
    """See `Solid`."""

    @property
    def mesh(self) -> HexMesh:  # type: ignore[override]
        return self.cells.mesh

    @cached_property
    def elements(self) -> CellElements:
        # Made once, since the weights of all cells go into them.
        young, share = map(self.cells.point_values, (self.young, np.ones(self.mesh.n_cells)))
        constants = self.mesh.edge, self.poisson, self.density
        span = self.cells.span if self.cells.is_mixed else None
        return CellElements(young, share, *constants, span, self.cells.kinds)

    @property
    def connectivity(self) -> NDArray[np.int32]:
        return np.asarray(self.cells.nodes)

    @property
    def hexmesh(self) -> HexMesh:
        return self.cells.hexmesh()

    @property
    def filled(self) -> Flags:
        return np.asarray(self.cells.voxels >= 0)

    def shape_values(self, elements: NDArray[np.integer], places: Array) -> Array:
        values = shape_functions(places)
        if self.cells.kinds is None:
            return values
        return np.asarray(values[:, None] @ node_weights(self.cells.kinds[elements]))[:, 0]

    def element_moduli(self, young: Array) -> Array:
        return self.cells.point_values(require_moduli(young, self.mesh.n_cells, points=False))

    def with_young(self, young: Array) -> Self:
        return replace(self, young=require_moduli(young, self.mesh.n_cells, points=False))

    @property
    def mass(self) -> float:
        return self.density * self.cells.volume


def finite_cell_model(
    cells: FiniteCells,
    young: Array,
    poisson: float = DEFAULT_POISSON,
    density: float = DEFAULT_DENSITY,
    damping: Damping | None = None,
) -> FiniteCellModel:
    """Solid of finite cells with moduli `young` (m,) [Pa] of the voxels.

    Raises UserError for what `carillon.fem.moduli.require_moduli` refuses.

    Examples
    --------
    >>> from carillon.fem.finite_cells.build import finite_cells
    >>> from carillon.fem.geometry import builtin_surface
    >>> cells = finite_cells(builtin_surface("box"), 8)
    >>> model = finite_cell_model(cells, np.full(cells.mesh.n_cells, 1e9))
    >>> model.n_dofs, round(model.mass, 9)
    (945, 3.0)
    """
    given = require_moduli(young, cells.mesh.n_cells, points=False)
    return FiniteCellModel(cells, given, poisson, density, damping)
