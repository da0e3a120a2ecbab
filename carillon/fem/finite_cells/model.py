"""A solid of finite cells with material."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Flags, Index
from carillon.fem.elements import Chosen, Elements
from carillon.fem.finite_cells.basis import basis
from carillon.fem.finite_cells.cells import FLOORS, FiniteCells
from carillon.fem.finite_cells.hanging import at_nodes, from_own, places_of_kinds
from carillon.fem.finite_cells.kinks import Kinks
from carillon.fem.finite_cells.matrices import nodal_mass, stiffness
from carillon.fem.finite_cells.shared_cells import (
    SharedCells,
    kinks_of,
    point_moduli,
    point_shares,
    side_moduli,
)
from carillon.fem.geometry import HexMesh
from carillon.fem.laplacian import CellGraph
from carillon.fem.model import Solid
from carillon.fem.moduli import require_moduli
from carillon.fem.regions import RegionOf, Regions
from carillon.fem.supports import Attached, Supports


@dataclass(frozen=True)
class CellElements(Elements):
    """Finite cells, integrated over what of them is inside."""

    ROWS = ("young", "shares", "span", "kinds", "law", "kink", "support")

    young: Array
    """(c, s, d) moduli [Pa] times the points' weights, see `carillon.fem.finite_cells.basis`, of
    what the cell holds of each of its regions."""
    shares: Array
    """(c, s, d) the points' weights of what the cell holds of each of its regions."""
    span: NDArray[np.int32]
    """(c,) edges in steps of the lattice."""
    kinds: NDArray[np.int32]
    """(c,) see `FiniteCells`."""
    edge: float
    """Step of the lattice [m]."""
    regions: Regions
    degree: int
    law: RegionOf | None = None
    """(c, s) regions of each cell; None if there is one, and s is 1."""
    kink: NDArray[np.int32] | None = None
    """(c,) numbers of the cells in `kinks`, -1 of those without."""
    kinks: Kinks | None = None
    """Of all cells at borders of regions; None if there are none."""
    support: NDArray[np.int32] | None = None
    attached: Attached | None = None

    @property
    def steps(self) -> None:
        return None

    @property
    def node_places(self) -> Index:
        scale = (self.span // self.degree)[:, None, None]
        return places_of_kinds(self.degree, self.kinds) * scale

    def edges(self, chosen: Chosen) -> Array:
        """Edges (c, 1) [m] of the chosen cells."""
        return self.edge * self.span[chosen][:, None].astype(float)

    @property
    def sort_key(self) -> Index:
        # None is needed: no two cells have the same nodes.
        return np.zeros(len(self), dtype=np.int64)

    def shape_values(self, elements: NDArray[np.integer], places: Array) -> Array:
        shape = basis(self.degree)
        inside = np.clip(places, 0.0, 1.0)
        # Beside a cell displacements go on as straight lines.
        slopes = np.einsum("pna,pa->pn", shape.gradients(inside), places - inside)
        values = (shape.functions(inside) + slopes)[:, :, None]
        kinds = self.kinds[elements]
        return np.asarray(from_own(self.degree, values, kinds)[:, :, 0])

    def by_law(self, chosen: Chosen) -> list[tuple[int, Index | slice, Array]]:
        """Regions, the chosen cells that hold some of each, and moduli (r, d) there."""
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
        return at_nodes(self.degree, self.own_stiffness(chosen), self.kinds[chosen])

    def own_stiffness(self, chosen: Chosen = slice(None)) -> Array:
        """Stiffness (c, 3 n, 3 n) [N/m] between the places in the cells that nodes have if none is
        that of a larger cell."""
        edges, parts = self.edges(chosen), self.by_law(chosen)
        if self.law is None:
            return stiffness(self.degree, self.regions.elasticity[0], edges * parts[0][2])
        size = 3 * basis(self.degree).n_nodes
        matrices = np.zeros((len(edges), size, size))
        for number, cells, moduli in parts:
            matrices[cells] += stiffness(self.degree, self.regions.elasticity[number], moduli)
        self._add_kinks(chosen, matrices)
        matrices *= edges[:, :, None]
        return matrices

    def with_regions(self, regions: Regions) -> Self:
        # How kinks follow the nodes stays as it is.
        kinks = None if self.kinks is None else replace(self.kinks, regions=regions)
        return replace(self, regions=regions, kinks=kinks)

    def _add_kinks(self, chosen: Chosen, matrices: Array) -> None:
        if self.kinks is None or self.kink is None or self.law is None:
            return
        kink = self.kink[chosen].astype(np.int64)
        own = np.flatnonzero(kink >= 0)
        if len(own):
            young, law = self.young[chosen][own], self.law[chosen][own]
            moduli = side_moduli(self.kinks.borders, kink[own], law, young)
            changed = matrices[own]
            self.kinks.add_stiffness(kink[own], moduli, changed)
            matrices[own] = changed

    @cached_property
    def share(self) -> Array:
        """(c, d) weighted densities at the points, over that of the first region."""
        return self._share(slice(None))

    def _share(self, chosen: Chosen) -> Array:
        shares = self.shares[chosen]
        if self.law is None:
            return shares[:, 0]
        ratios = (self.regions.density / self.regions.density[0])[self.law[chosen]]
        return np.einsum("cs,csp->cp", ratios, shares)

    def own_mass(self, chosen: Chosen = slice(None)) -> Array:
        """Mass (c, n, n) [kg] between the places of `own_stiffness`."""
        scale = float(self.regions.density[0]) * self.edges(chosen) ** 3
        return nodal_mass(self.degree, scale * self._share(chosen))

    def _nodal_mass(self, chosen: Chosen) -> Array:
        return at_nodes(self.degree, self.own_mass(chosen), self.kinds[chosen])


@dataclass(frozen=True, repr=False)
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

    @property
    def positions(self) -> Array:
        return self.cells.positions

    @property
    def node_grid(self) -> NDArray[np.int32]:
        return self.cells.node_grid

    @cached_property
    def elements(self) -> CellElements:
        # Made once, since the weights of all cells go into them.
        young, law = self._point_moduli(self.young)
        support, attached = self.attached()
        kink, kinks = self._kinks()
        return CellElements(
            young,
            self._shares(),
            self.cells.span,
            self.cells.kinds,
            self.cells.step,
            self.regions,
            self.cells.degree,
            law,
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

    @property
    def _floors(self) -> tuple[float, float]:
        return FLOORS[self.cells.degree]

    def linear_moduli(self, along: Array) -> Array:
        """Moduli (c, s, d) at the points of cells, of voxels' (m,) that may be negative."""
        return self._point_moduli(along)[0]

    def _point_moduli(self, young: Array) -> tuple[Array, RegionOf | None]:
        if self.region is None:
            return self.cells.point_values(young, self._floors[0])[:, None], None
        return point_moduli(self.cells, self.regions, self.region, self.shared, young)

    def _shares(self) -> Array:
        if self.region is None:
            return self.cells.point_values(np.ones(self.mesh.n_cells), self._floors[1])[:, None]
        return point_shares(self.cells, self.region, self.shared)

    @property
    def connectivity(self) -> NDArray[np.int32]:
        return np.asarray(self.cells.nodes)

    @property
    def graph(self) -> CellGraph:
        cells = self.cells
        return CellGraph((cells.corner // cells.span.min()).astype(np.int64), cells.neighbours)

    @property
    def boxes(self) -> tuple[Array, Array]:
        cells = self.cells
        return cells.origin + cells.step * cells.corner, cells.edges

    def far_from_material(self, elements: Index, points: Array) -> Array:
        cells = self.cells
        low, edge = cells.frames()
        corners, edges = self.boxes
        middle = corners[cells.cell] + edges[cells.cell, None] * (low + edge[:, None] / 2.0)
        first, last = (np.searchsorted(cells.cell, elements, side=s) for s in ("left", "right"))
        result = np.full(elements.shape, np.inf)
        for place in np.ndindex(*elements.shape):
            some = middle[first[place] : last[place]]
            result[place] = np.linalg.norm(some - points[place[0]], axis=1).min()
        return result

    def element_moduli(self, young: Array) -> Array:
        given = require_moduli(young, self.mesh.n_cells, points=False)
        return self._point_moduli(given)[0]

    def with_young(self, young: Array) -> Self:
        return replace(self, young=require_moduli(young, self.mesh.n_cells, points=False))

    @property
    def mass(self) -> float:
        if self.region is None:
            return float(self.regions.density[0]) * self.cells.volume
        volumes = self.elements.share.sum(axis=1) * self.cells.edges**3
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
    (411, 3.0)
    """
    given = require_moduli(young, cells.mesh.n_cells, points=False)
    regions = Regions.one() if regions is None else regions
    return FiniteCellModel(cells, given, regions, region, shared, supports)
