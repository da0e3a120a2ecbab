"""The elastic solid that K u = lambda M u is assembled from, and its mass, centre and inertia."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Any, Self, TypedDict, Unpack, cast

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Flags
from carillon.fem.block import ALL_FILLED
from carillon.fem.element import DEFAULT_POISSON, shape_functions
from carillon.fem.elements import Chosen, Elements, HexElements
from carillon.fem.geometry import HexMesh
from carillon.fem.geometry.hanging import node_weights
from carillon.fem.moduli import at_points, require_moduli

RIGID_MODES = 6
"""Motions without strain of a connected free body."""

DEFAULT_DENSITY = 1000.0
"""Mass density [kg/m^3] where none is given."""


Damping = tuple[float, float]
"""Rayleigh's coefficients of mass [1/s] and of stiffness [s]."""


class Solid(ABC):
    """A solid with material in one discretisation."""

    mesh: HexMesh
    """Voxels that carry the material, or the elements that replace them, and all nodes."""
    young: Array
    """Young's moduli [Pa] that belong to them."""
    poisson: float
    density: float
    """Poisson's ratio and mass density [kg/m^3]."""
    damping: Damping | None
    """Rayleigh's coefficients of mass [1/s] and of stiffness [s], if they are known."""

    @property
    def n_dofs(self) -> int:
        """Number of displacement unknowns."""
        return 3 * self.mesh.n_nodes

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
    def hexmesh(self) -> HexMesh:
        """The elements as cubes with nodes at their corners, by which neighbours are found."""

    @property
    @abstractmethod
    def filled(self) -> Flags:
        """Which octants (c, 8) of the elements hold material."""

    @abstractmethod
    def shape_values(self, elements: NDArray[np.integer], places: Array) -> Array:
        """Weights (p, k) of the nodes of `elements` (p,) at places (p, 3) in them, from 0 to 1."""

    @abstractmethod
    def element_moduli(self, young: Array) -> Array:
        """Moduli (c, p) [Pa] at the elements' points from those that a user gives.

        Raises UserError for what `carillon.fem.moduli.require_moduli` refuses.
        """

    @abstractmethod
    def with_young(self, young: Array) -> Self:
        """Copy of the solid with other Young's moduli [Pa], see `element_moduli`."""

    def with_constants(
        self, poisson: float, density: float, damping: Damping | None = None
    ) -> Self:
        """The same solid with another Poisson's ratio, mass density [kg/m^3] and damping."""
        # Every kind of solid is a dataclass.
        return replace(cast(Any, self), poisson=poisson, density=density, damping=damping)

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


@dataclass(frozen=True)
class ElasticModel(Solid):
    """A hexahedral mesh with material, an element for each of its cells."""

    mesh: HexMesh
    young: Array
    """(m, 8) Young's modulus [Pa] at each cell's quadrature points, taken as it is: what users give
    goes through `fine_model` and `with_young`."""
    fill: NDArray[np.uint8]
    """(m,) bit pattern of the octants of each cell that hold mass; 255 everywhere on a fine
    mesh."""
    poisson: float = DEFAULT_POISSON
    density: float = DEFAULT_DENSITY
    """Mass density of the filled octants [kg/m^3]."""
    lumped: bool = False
    """Whether the mass is row-sum lumped (diagonal) instead of consistent."""
    lumped_share: float = 0.0
    """Share of lumped in the mass of cells whose octants are all filled; the rest is consistent. A
    mixture disperses less than either (`dataset_gen.objectives.lumped_share`). In a mixed mesh the
    mass of fine cells has none."""
    damping: Damping | None = None

    @property
    def elements(self) -> HexElements:
        constants = self.poisson, self.density, self.lumped, self.lumped_share
        return HexElements(self.young, self.fill, self.mesh.edge, *constants, self.mesh.kinds)

    @property
    def connectivity(self) -> NDArray[np.int32]:
        return np.asarray(self.mesh.cells)

    @property
    def hexmesh(self) -> HexMesh:
        return self.mesh

    @property
    def filled(self) -> Flags:
        return np.unpackbits(self.fill[:, None], axis=1, bitorder="little").astype(bool)

    def shape_values(self, elements: NDArray[np.integer], places: Array) -> Array:
        """Trilinear weights (p, 8); what a hanging corner says is the nodes' that it hangs from."""
        weights = shape_functions(places)
        if self.mesh.kinds is None:
            return weights
        return np.einsum("pk,pkj->pj", weights, node_weights()[self.mesh.kinds[elements]])

    def element_moduli(self, young: Array) -> Array:
        return at_points(require_moduli(young, self.mesh.n_cells))

    def with_young(self, young: Array) -> Self:
        return replace(self, young=self.element_moduli(young))

    @property
    def mass(self) -> float:
        octants = np.unpackbits(self.fill[:, None], axis=1).sum(axis=1, dtype=int)
        if self.mesh.span is not None:
            octants = octants * self.mesh.span.astype(int) ** 3
        return float(octants.sum() * self.density * (self.mesh.edge / 2.0) ** 3)


class Constants(TypedDict, total=False):
    """Constants of an `ElasticModel` that are the same in every cell."""

    poisson: float
    density: float
    lumped: bool
    damping: Damping | None


def fine_model(mesh: HexMesh, young: Array, **constants: Unpack[Constants]) -> ElasticModel:
    """Solid of a fine mesh with moduli `young`, (m,) or (m, 8) [Pa].

    Raises UserError for what `carillon.fem.moduli.require_moduli` refuses.

    Examples
    --------
    >>> from carillon.fem.geometry import hexmesh_from_grid
    >>> mesh = hexmesh_from_grid(np.array([[0, 0, 0], [1, 0, 0]]), np.zeros(3), 0.5)
    >>> model = fine_model(mesh, np.array([1e9, 2e9]), density=1000.0)
    >>> model.n_dofs, model.mass
    (36, 250.0)
    """
    return ElasticModel(
        mesh,
        at_points(require_moduli(young, mesh.n_cells)),
        np.full(mesh.n_cells, ALL_FILLED, dtype=np.uint8),
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
    corners = model.mesh.nodes[model.connectivity]
    nodal = model.nodal_mass()
    mass = float(nodal.sum())
    centre = np.einsum("cab,cbi->i", nodal, corners) / mass
    arms = corners - centre
    second = np.einsum("cai,cab,cbj->ij", arms, nodal, arms)
    moments, axes = np.linalg.eigh(np.trace(second) * np.eye(3) - second)
    axes[:, 0] *= np.sign(np.linalg.det(axes))
    return MassProperties(mass, centre, moments, axes)
