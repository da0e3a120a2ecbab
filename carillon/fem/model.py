"""The elastic solid that K u = lambda M u is assembled from, and its mass, centre and inertia."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Self, TypedDict, Unpack, cast

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Flags, Index
from carillon.fem.block import ALL_FILLED
from carillon.fem.element import CORNERS
from carillon.fem.elements import Chosen, Elements, HexElements
from carillon.fem.embedding import embedding
from carillon.fem.geometry import HexMesh
from carillon.fem.laplacian import CellGraph
from carillon.fem.moduli import at_points, require_moduli
from carillon.fem.regions import DEFAULT_DENSITY as DEFAULT_DENSITY
from carillon.fem.regions import Damping as Damping
from carillon.fem.regions import RegionOf, Regions
from carillon.fem.solid_html import solid_html
from carillon.fem.supports import Attached, Supports
from carillon.notebook.card import html_or_text

RIGID_MODES = 6
"""Motions without strain of a connected free body."""


class Solid(ABC):
    """A solid with material in one discretisation."""

    mesh: HexMesh
    """Voxels that carry the material, or the elements that replace them, and all nodes."""
    young: Array
    """Young's moduli [Pa] that belong to them."""
    regions: Regions
    """Materials, without these moduli."""
    region: RegionOf | None
    """Region of each cell, (m,) or that of its octants (m, 8); None if there is one."""
    supports: Supports | None
    """What holds it, or is fixed to it; None of a free solid."""

    def __repr__(self) -> str:
        kind = type(self).__name__
        held = "free" if self.supports is None else "held"
        elements = len(self.connectivity)
        return f"<{kind}: {elements:,} elements, {self.n_dofs:,} unknowns, {held}>"

    def _repr_html_(self) -> str:
        return html_or_text(self, lambda: solid_html(self))

    @property
    def poisson(self) -> float | None:
        """Poisson's ratio; None if it is not the same all over, or has no meaning."""
        return self.regions.poisson

    @property
    @abstractmethod
    def density(self) -> float:
        """Mean mass density [kg/m^3], without masses that are fixed to it."""

    @property
    def damping(self) -> Damping | None:
        """Rayleigh's coefficients, if they are known, and the same all over."""
        known = set(self.regions.damping)
        return known.pop() if len(known) == 1 else None

    @cached_property
    def rigid_modes(self) -> int:
        """Motions without strain that its supports leave it."""
        if self.supports is None:
            return RIGID_MODES
        nodes = self.positions
        centre = nodes.mean(axis=0)
        extent = float(np.abs(nodes - centre).max())
        return self.supports.free_motions(centre, extent).shape[1]

    @property
    def positions(self) -> Array:
        """Positions (n, 3) [m] of the nodes, whose displacements are unknown."""
        return self.mesh.nodes

    @property
    def node_grid(self) -> NDArray[np.int32]:
        """Integer coordinates (n, 3) of the nodes."""
        return self.mesh.node_grid

    @property
    def n_nodes(self) -> int:
        """Number of nodes."""
        return len(self.node_grid)

    @property
    def n_dofs(self) -> int:
        """Number of displacement unknowns."""
        return 3 * self.n_nodes

    @property
    @abstractmethod
    def elements(self) -> Elements:
        """All elements, in the order of `connectivity`."""

    @property
    @abstractmethod
    def connectivity(self) -> NDArray[np.int32]:
        """Nodes (c, k) of each element."""

    @property
    @abstractmethod
    def graph(self) -> HexMesh | CellGraph:
        """The elements, and which of them share a face."""

    @property
    @abstractmethod
    def boxes(self) -> tuple[Array, Array]:
        """Lowest corners (c, 3) and edges (c,) [m] of the elements."""

    @abstractmethod
    def far_from_material(self, elements: Index, points: Array) -> Array:
        """Distance (p, c) [m] of `points` (p, 3) [m] from the nearest voxel, or octant of one, that
        holds material of `elements` (p, c)."""

    @abstractmethod
    def element_moduli(self, young: Array) -> Array:
        """Moduli (c, p) [Pa] at the elements' points from those that a user gives.

        Raises UserError for what `carillon.fem.moduli.require_moduli` refuses.
        """

    @abstractmethod
    def with_young(self, young: Array) -> Self:
        """Copy of the solid with other Young's moduli [Pa], see `element_moduli`."""

    def with_regions(self, regions: Regions) -> Self:
        """The same solid of other materials, with the same moduli."""
        # Every kind of solid is a dataclass.
        return replace(cast(Any, self), regions=regions)

    def with_supports(self, supports: Supports | None) -> Self:
        """The same solid held otherwise."""
        return replace(cast(Any, self), supports=supports)

    def attached(self) -> tuple[NDArray[np.int32] | None, Attached | None]:
        """Supports as they act on the elements, see `Elements`."""
        if self.supports is None:
            return None, None
        free = self.with_supports(None)
        found, weights = embedding(free, self.supports.positions)
        count = len(self.connectivity)
        return Attached.to_elements(self.supports, found, weights, count)

    @property
    @abstractmethod
    def mass(self) -> float:
        """Mass of the solid [kg]."""

    def stiffness(self, chosen: Chosen = slice(None)) -> Array:
        """Element stiffness matrices (c, 3 k, 3 k) [N/m] of the chosen elements."""
        return self.elements.stiffness(chosen)

    def nodal_mass(self, chosen: Chosen = slice(None)) -> Array:
        """Element masses (c, k, k) [kg] of the chosen elements, see `Elements.nodal_mass`."""
        return self.elements.nodal_mass(chosen)


@dataclass(frozen=True, repr=False)
class ElasticModel(Solid):
    """A hexahedral mesh with material, an element for each of its cells."""

    mesh: HexMesh
    young: Array
    """(m, 8) Young's modulus [Pa] at each cell's quadrature points, taken as it is: what users give
    goes through `fine_model` and `with_young`."""
    fill: NDArray[np.uint8]
    """(m,) bit pattern of the octants of each cell that hold mass; 255 everywhere on a fine
    mesh."""
    regions: Regions = field(default_factory=Regions.one)
    region: RegionOf | None = None
    """(m, 8) region of each octant, and of the quadrature point in it; None if there is one."""
    lumped: bool = False
    """Whether the mass is row-sum lumped (diagonal) instead of consistent."""
    lumped_share: float = 0.0
    """Share of lumped in the mass of cells whose octants are all filled; the rest is consistent. A
    mixture disperses less than either (`dataset_gen.objectives.lumped_share`). In a mixed mesh the
    mass of fine cells has none."""
    supports: Supports | None = None

    @cached_property
    def elements(self) -> HexElements:
        support, attached = self.attached()
        return HexElements(
            self.young,
            self.fill,
            self.mesh.edge,
            self.regions,
            self.lumped,
            self.lumped_share,
            self.mesh.kinds,
            self.region,
            support,
            attached,
        )

    @property
    def connectivity(self) -> NDArray[np.int32]:
        return np.asarray(self.mesh.cells)

    @property
    def graph(self) -> HexMesh:
        return self.mesh

    @property
    def boxes(self) -> tuple[Array, Array]:
        mesh = self.mesh
        span = np.ones(mesh.n_cells) if mesh.span is None else mesh.span.astype(float)
        return mesh.origin + mesh.edge * mesh.grid, mesh.edge * span

    def far_from_material(self, elements: Index, points: Array) -> Array:
        low, edges = self.boxes
        middles = edges[elements][:, :, None, None] * (CORNERS + 0.5) / 2.0
        centres = low[elements][:, :, None] + middles
        distance = np.linalg.norm(centres - points[:, None, None], axis=3)
        return np.asarray(np.where(self.filled[elements], distance, np.inf).min(axis=2))

    @property
    def filled(self) -> Flags:
        """Which octants (c, 8) of the elements hold material."""
        return np.unpackbits(self.fill[:, None], axis=1, bitorder="little").astype(bool)

    def element_moduli(self, young: Array) -> Array:
        return at_points(require_moduli(young, self.mesh.n_cells))

    def with_young(self, young: Array) -> Self:
        return replace(self, young=self.element_moduli(young))

    @property
    def mass(self) -> float:
        octants = self._octants
        if self.region is None:
            held = float(octants.sum())
            return float(held * self.regions.density[0] * (self.mesh.edge / 2.0) ** 3)
        held = float((octants * self.regions.density[self.region]).sum())
        return held * (self.mesh.edge / 2.0) ** 3

    @property
    def density(self) -> float:
        if self.region is None:
            return float(self.regions.density[0])
        return self.mass / float(self._octants.sum() * (self.mesh.edge / 2.0) ** 3)

    @property
    def _octants(self) -> NDArray[np.integer]:
        """Volume (m, 8) of each octant that is filled, in those of the smaller cells."""
        octants = np.unpackbits(self.fill[:, None], axis=1, bitorder="little").astype(int)
        return (
            octants
            if self.mesh.span is None
            else octants * self.mesh.span[:, None].astype(int) ** 3
        )

    @property
    def cell_regions(self) -> RegionOf | None:
        """Region (m,) of each cell of a fine mesh; None if there is one."""
        return None if self.region is None else self.region[:, 0]

    @property
    def constants(self) -> "Constants":
        """What models of the same solid on other meshes share with it, but for the regions'
        places."""
        return {"regions": self.regions, "lumped": self.lumped, "supports": self.supports}


class Constants(TypedDict, total=False):
    """What is the same in every cell of an `ElasticModel`."""

    regions: Regions
    lumped: bool
    supports: Supports | None


def fine_model(
    mesh: HexMesh, young: Array, region: RegionOf | None = None, **constants: Unpack[Constants]
) -> ElasticModel:
    """Solid of a fine mesh with moduli `young`, (m,) or (m, 8) [Pa], and the `region` (m,) of each.

    Raises UserError for what `carillon.fem.moduli.require_moduli` refuses.

    Examples
    --------
    >>> from carillon.fem.geometry import hexmesh_from_grid
    >>> mesh = hexmesh_from_grid(np.array([[0, 0, 0], [1, 0, 0]]), np.zeros(3), 0.5)
    >>> model = fine_model(mesh, np.array([1e9, 2e9]), regions=Regions.one(density=1000.0))
    >>> model.n_dofs, model.mass
    (36, 250.0)
    """
    return ElasticModel(
        mesh,
        at_points(require_moduli(young, mesh.n_cells)),
        np.full(mesh.n_cells, ALL_FILLED, dtype=np.uint8),
        region=None if region is None else np.repeat(region[:, None], 8, axis=1),
        **constants,
    )


@dataclass(frozen=True)
class MassProperties:
    """A solid as a rigid body."""

    mass: float
    """Mass of the whole solid [kg]."""
    centre: Array
    """(3,) centre of mass [m]."""
    moments: Array
    """(3,) principal moments of inertia about it [kg m^2], ascending."""
    axes: Array
    """(3, 3) rotation whose columns are the principal axes."""


def mass_properties(model: Solid) -> MassProperties:
    """Integrals of the density over the solid; exact, as elements have all linear functions."""
    corners = model.positions[model.connectivity]
    nodal = model.nodal_mass()
    mass = float(nodal.sum())
    centre = np.einsum("cab,cbi->i", nodal, corners) / mass
    arms = corners - centre
    second = np.einsum("cai,cab,cbj->ij", arms, nodal, arms)
    moments, axes = np.linalg.eigh(np.trace(second) * np.eye(3) - second)
    axes[:, 0] *= np.sign(np.linalg.det(axes))
    return MassProperties(mass, centre, moments, axes)
