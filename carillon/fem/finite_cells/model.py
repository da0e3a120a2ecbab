"""A solid of finite cells with material."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Flags, Index
from carillon.fem.block import NODES
from carillon.fem.elements import Chosen, Elements
from carillon.fem.finite_cells.cells import FiniteCells
from carillon.fem.finite_cells.hanging import at_nodes, node_places, node_weights
from carillon.fem.finite_cells.kinks import Kinks
from carillon.fem.finite_cells.shapes import point_mass, point_stiffness, shape_functions
from carillon.fem.finite_cells.shared_cells import (
    SharedCells,
    kinks_of,
    point_moduli,
    point_shares,
    side_moduli,
)
from carillon.fem.geometry import HexMesh
from carillon.fem.model import Solid
from carillon.fem.moduli import require_moduli
from carillon.fem.regions import RegionOf, Regions
from carillon.fem.supports import Attached, Supports


@dataclass(frozen=True)
class CellElements(Elements):
    """Quadratic cells of twice the lattice's spacing, integrated over what of them is inside."""

    ROWS = ("young", "shares", "law", "span", "kinds", "kink", "support")

    young: Array
    """(c, s, 125) moduli [Pa] times the points' weights, see `carillon.fem.finite_cells.shapes`, of
    what the cell holds of each of its regions."""
    shares: Array
    """(c, s, 125) the points' weights of what the cell holds of each of its regions."""
    edge: float
    """Step of the lattice [m]."""
    regions: Regions
    law: RegionOf | None = None
    """(c, s) regions of each cell; None if there is one, and s is 1."""
    span: NDArray[np.int32] | None = None
    kinds: Index | None = None
    """(c,) see `FiniteCells`, of cells of two sizes; else None."""
    kink: NDArray[np.int32] | None = None
    """(c,) numbers of the cells in `kinks`, -1 of those without."""
    kinks: Kinks | None = None
    """Of all cells at borders of regions; None if there are none."""
    support: NDArray[np.int32] | None = None
    attached: Attached | None = None

    @property
    def steps(self) -> int:
        return 2 if self.span is None else 4

    @property
    def node_places(self) -> Index:
        if self.span is None or self.kinds is None:
            return np.broadcast_to(NODES, (len(self), *NODES.shape))
        return node_places(self.kinds) * (self.span // 2)[:, None, None]

    def edges(self, chosen: Chosen) -> Array | float:
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

    def shape_values(self, elements: NDArray[np.integer], places: Array) -> Array:
        values = shape_functions(places)
        if self.kinds is None:
            return values
        return np.asarray(values[:, None] @ node_weights(self.kinds[elements]))[:, 0]

    def by_law(self, chosen: Chosen) -> list[tuple[int, Index | slice, Array]]:
        """Regions, the chosen cells that hold some of each, and moduli (r, 125) there."""
        young = self.young[chosen]
        if self.law is None:
            return [(0, slice(None), young[:, 0])]
        law = self.law[chosen]
        found: list[tuple[int, Index | slice, Array]] = []
        for number in np.unique(law):
            cell, slot = np.nonzero((law == number) & young.any(axis=2))
            found.append((int(number), cell, young[cell, slot]))
        return found

    def moduli_of(self, chosen: Flags) -> Array:
        there = chosen[0] if self.law is None else chosen[self.law][:, :, None]
        return np.asarray(np.where(there, self.young, 0.0))

    def free_stiffness(self, chosen: Chosen = slice(None)) -> Array:
        edges = self.edges(chosen)
        parts = self.by_law(chosen)
        if self.law is None:
            matrices = (edges * parts[0][2]) @ point_stiffness(self.regions.laws[0])
        else:
            matrices = np.zeros((len(self.young[chosen]), 81 * 81))
            for number, cells, moduli in parts:
                matrices[cells] += moduli @ point_stiffness(self.regions.laws[number])
            self._add_kinks(chosen, matrices.reshape(-1, 81, 81))
            matrices *= edges
        return self._between_nodes(matrices.reshape(-1, 81, 81), chosen)

    def _add_kinks(self, chosen: Chosen, matrices: Array) -> None:
        if self.kinks is None or self.kink is None or self.law is None:
            return
        kink = self.kink[chosen]
        own = np.flatnonzero(kink >= 0)
        if len(own):
            young, law = self.young[chosen][own], self.law[chosen][own]
            moduli = side_moduli(self.kinks.borders, kink[own], law, young)
            changed = matrices[own]
            self.kinks.add_stiffness(kink[own], moduli, changed)
            matrices[own] = changed

    @cached_property
    def share(self) -> Array:
        """(c, 125) weighted densities at the points, over that of the first region."""
        return self._share(slice(None))

    def _share(self, chosen: Chosen) -> Array:
        shares = self.shares[chosen]
        if self.law is None:
            return shares[:, 0]
        ratios = (self.regions.density / self.regions.density[0])[self.law[chosen]]
        return np.einsum("cs,csp->cp", ratios, shares)

    def _nodal_mass(self, chosen: Chosen) -> Array:
        scale = float(self.regions.density[0]) * self.edges(chosen) ** 3
        matrices = (scale * self._share(chosen)) @ point_mass()
        return self._between_nodes(matrices.reshape(-1, 27, 27), chosen)


@dataclass(frozen=True)
class FiniteCellModel(Solid):
    """Finite cells with a modulus for every voxel that holds material."""

    cells: FiniteCells
    """The mesh."""
    young: Array
    """(m,) Young's modulus [Pa] of each voxel, taken as it is: what users give goes through
    `finite_cell_model` and `with_young`."""
    regions: Regions = field(default_factory=Regions.one)
    region: RegionOf | None = None
    """(m,) region that most of each voxel is of; None if there is one."""
    shared: SharedCells | None = None
    """Cells with voxels of several regions; None if there are none."""
    supports: Supports | None = None

    @property
    def mesh(self) -> HexMesh:  # type: ignore[override]
        return self.cells.mesh

    @cached_property
    def elements(self) -> CellElements:
        # Made once, since the weights of all cells go into them.
        young, law = self._point_moduli(self.young)
        shares = self._shares()
        span = self.cells.span if self.cells.is_mixed else None
        support, attached = self.attached()
        kink, kinks = self._kinks()
        return CellElements(
            young,
            shares,
            self.mesh.edge,
            self.regions,
            law,
            span,
            self.cells.kinds,
            kink,
            kinks,
            support,
            attached,
        )

    def _kinks(self) -> tuple[NDArray[np.int32] | None, Kinks | None]:
        if self.region is None or self.shared is None:
            return None, None
        kinks = kinks_of(self.cells, self.regions, self.region, self.shared)
        if kinks is None:
            return None, None
        kink = np.full(len(self.cells), -1, dtype=np.int32)
        kink[kinks.borders.cell] = np.arange(len(kinks.borders))
        return kink, kinks

    def linear_moduli(self, along: Array) -> Array:
        """Moduli (c, s, 125) at the points of cells, of voxels' (m,) that may be negative."""
        return self._point_moduli(along)[0]

    def _point_moduli(self, young: Array) -> tuple[Array, RegionOf | None]:
        if self.region is None:
            return self.cells.point_values(young)[:, None], None
        return point_moduli(self.cells, self.regions, self.region, self.shared, young)

    def _shares(self) -> Array:
        if self.region is None:
            return self.cells.point_values(np.ones(self.mesh.n_cells))[:, None]
        return point_shares(self.cells, self.region, self.shared)

    @property
    def connectivity(self) -> NDArray[np.int32]:
        return np.asarray(self.cells.nodes)

    @property
    def hexmesh(self) -> HexMesh:
        return self.cells.hexmesh()

    @property
    def filled(self) -> Flags:
        return np.asarray(self.cells.voxels >= 0)

    def element_moduli(self, young: Array) -> Array:
        given = require_moduli(young, self.mesh.n_cells, points=False)
        return self._point_moduli(given)[0]

    def with_young(self, young: Array) -> Self:
        return replace(self, young=require_moduli(young, self.mesh.n_cells, points=False))

    @property
    def mass(self) -> float:
        if self.region is None:
            return float(self.regions.density[0]) * self.cells.volume
        edges = self.cells.span * self.mesh.edge
        volumes = self.elements.share.sum(axis=1) * edges**3
        return float(self.regions.density[0] * volumes.sum())

    @property
    def density(self) -> float:
        if self.region is None:
            return float(self.regions.density[0])
        return self.mass / self.cells.volume


def finite_cell_model(
    cells: FiniteCells,
    young: Array,
    regions: Regions | None = None,
    region: RegionOf | None = None,
    shared: SharedCells | None = None,
    supports: Supports | None = None,
) -> FiniteCellModel:
    """Solid of finite cells with moduli `young` (m,) [Pa] of the voxels, and the `region` of each.

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
    regions = Regions.one() if regions is None else regions
    return FiniteCellModel(cells, given, regions, region, shared, supports)
