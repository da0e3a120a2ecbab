"""The elastic solid that the eigenvalue problem K u = lambda M u is assembled from."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypedDict, Unpack

import numpy as np
from numpy.typing import NDArray

from carillon.fem.block import ALL_FILLED, coarse_cell_mass
from carillon.fem.element import DEFAULT_POISSON, quadrature_stiffness
from carillon.fem.geometry import HexMesh
from carillon.fem.moduli import at_points, require_moduli

Array = NDArray[np.float64]
Chosen = NDArray[np.integer] | NDArray[np.bool_] | slice

RIGID_MODES = 6
"""Motions without strain of a connected free body."""

DEFAULT_DENSITY = 1000.0
"""Mass density [kg/m^3] where none is given."""


@dataclass(frozen=True)
class Elements:
    """Cubic elements of one size with material, wherever their nodes may be.

    Attributes
    ----------
    young : (c, 8)
        See `ElasticModel` [Pa].
    fill : (c,)
        See `ElasticModel`.
    edge
        Edge of an element [m].
    poisson, density, lumped, lumped_share
        See `ElasticModel`.
    """

    young: Array
    fill: NDArray[np.uint8]
    edge: float
    poisson: float
    density: float
    lumped: bool
    lumped_share: float

    def __len__(self) -> int:
        return len(self.fill)

    def with_material(self, young: Array, fill: NDArray[np.uint8]) -> Elements:
        """Elements of the same size and constants with other moduli and octants."""
        return replace(self, young=young, fill=fill)

    def stiffness(self, chosen: Chosen = slice(None)) -> Array:
        """Element stiffness matrices (c, 24, 24) [N/m] of the chosen elements."""
        kernels = quadrature_stiffness(self.poisson).reshape(8, 576)
        return (self.edge * (self.young[chosen] @ kernels)).reshape(-1, 24, 24)

    def nodal_mass(self, chosen: Chosen = slice(None)) -> Array:
        """Element masses (c, 8, 8) [kg] between corners, the same for each displacement component.

        The trilinear shape functions are integrated over the filled octants: P^T M P of the fine
        cells that a coarse cell stands for, and the consistent mass of a fine cell.
        """
        octants = np.unpackbits(self.fill[chosen][:, None], axis=1, bitorder="little")
        scale = self.density * (self.edge / 2.0) ** 3
        mass = (scale * octants @ coarse_cell_mass().reshape(8, 64)).reshape(-1, 8, 8)
        if not (self.lumped or self.lumped_share):
            return np.asarray(mass)
        share = np.where(self.fill[chosen] == ALL_FILLED, self.lumped_share, 0.0)
        if self.lumped:
            share[:] = 1.0
        lumped = mass.sum(axis=2)[:, :, None] * np.eye(8)
        return np.asarray(mass + share[:, None, None] * (lumped - mass))


@dataclass(frozen=True)
class ElasticModel:
    """A hexahedral mesh with material.

    Parameters
    ----------
    mesh
        Nodes and cells.
    young : (m, 8)
        Young's modulus [Pa] at each cell's quadrature points, taken as it is: what users
        give goes through `fine_model` and `with_young`.
    fill : (m,)
        Bit pattern of the octants of each cell that hold mass; 255 everywhere on a fine mesh.
    poisson
        Poisson's ratio.
    density
        Mass density of the filled octants [kg/m^3].
    lumped
        Whether the mass is row-sum lumped (diagonal) instead of consistent.
    lumped_share
        Share of lumped in the mass of cells whose octants are all filled; the rest is consistent.
        A mixture disperses less than either (`dataset_gen.objectives.lumped_share`).
    """

    mesh: HexMesh
    young: Array
    fill: NDArray[np.uint8]
    poisson: float = DEFAULT_POISSON
    density: float = DEFAULT_DENSITY
    lumped: bool = False
    lumped_share: float = 0.0

    @property
    def n_dofs(self) -> int:
        """Number of displacement unknowns."""
        return 3 * self.mesh.n_nodes

    @property
    def elements(self) -> Elements:
        """The elements of all cells."""
        return Elements(
            self.young,
            self.fill,
            self.mesh.edge,
            self.poisson,
            self.density,
            self.lumped,
            self.lumped_share,
        )

    def with_young(self, young: Array) -> ElasticModel:
        """The same solid with other moduli, (m,) or (m, 8) [Pa].

        Raises
        ------
        UserError
            For what `carillon.fem.moduli.require_moduli` refuses.
        """
        return replace(self, young=at_points(require_moduli(young, self.mesh.n_cells)))

    def stiffness(self, cells: Chosen = slice(None)) -> Array:
        """Element stiffness matrices (c, 24, 24) [N/m] of the chosen cells."""
        return self.elements.stiffness(cells)

    def nodal_mass(self, cells: Chosen = slice(None)) -> Array:
        """Element masses (c, 8, 8) [kg] of the chosen cells, see `Elements.nodal_mass`."""
        return self.elements.nodal_mass(cells)

    @property
    def mass(self) -> float:
        """Mass of the solid [kg]."""
        octants = np.unpackbits(self.fill).sum()
        return float(octants * self.density * (self.mesh.edge / 2.0) ** 3)


class Constants(TypedDict, total=False):
    """Constants of an `ElasticModel` that are the same in every cell."""

    poisson: float
    density: float
    lumped: bool


def fine_model(mesh: HexMesh, young: Array, **constants: Unpack[Constants]) -> ElasticModel:
    """Model of a fine mesh with moduli `young`, (m,) or (m, 8) [Pa].

    Raises
    ------
    UserError
        For what `carillon.fem.moduli.require_moduli` refuses.

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
