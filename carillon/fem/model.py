"""The elastic solid that the eigenvalue problem K u = lambda M u is assembled from."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, TypedDict, Unpack

import numpy as np
from numpy.typing import NDArray

from carillon.fem.block import ALL_FILLED, coarse_cell_mass
from carillon.fem.element import CORNERS, DEFAULT_POISSON, quadrature_stiffness
from carillon.fem.geometry import HexMesh
from carillon.fem.geometry.hanging import WHOLE, node_places, node_weights
from carillon.fem.moduli import at_points, require_moduli

Array = NDArray[np.float64]
Chosen = NDArray[np.integer] | NDArray[np.bool_] | slice

RIGID_MODES = 6
"""Motions without strain of a connected free body."""

DEFAULT_DENSITY = 1000.0
"""Mass density [kg/m^3] where none is given."""


@dataclass(frozen=True)
class Elements:
    """Cubic elements with material, wherever their nodes may be.

    Attributes
    ----------
    young : (c, 8)
        See `ElasticModel` [Pa].
    fill : (c,)
        See `ElasticModel`.
    edge
        Edge of an element [m], of the smaller ones in a mixed mesh.
    poisson, density, lumped, lumped_share
        See `ElasticModel`.
    kinds : (c,) int32
        Of the elements of a mixed mesh, see `carillon.fem.geometry.hanging`; else None.
    """

    young: Array
    fill: NDArray[np.uint8]
    edge: float
    poisson: float
    density: float
    lumped: bool
    lumped_share: float
    kinds: NDArray[np.int32] | None = None

    def __len__(self) -> int:
        return len(self.fill)

    def of(self, young: Array, fill: NDArray[np.uint8], *kinds: NDArray[np.int32]) -> Elements:
        """Other elements of the same solid; with kinds if these have kinds."""
        return replace(self, young=young, fill=fill, kinds=kinds[0] if kinds else None)

    def arrays(self) -> list[NDArray[Any]]:
        """What differs from element to element: the arguments of `of`."""
        kinds = [] if self.kinds is None else [self.kinds]
        return [self.young, self.fill, *kinds]

    def with_young(self, young: Array) -> Elements:
        """The same elements with other moduli."""
        return replace(self, young=young)

    @property
    def steps(self) -> int:
        """Edges along the largest element."""
        return 1 if self.kinds is None else 2

    @property
    def node_places(self) -> NDArray[np.int64]:
        """Places (c, 8, 3) of the nodes about a point of each element, in edges."""
        if self.kinds is None:
            return np.broadcast_to(CORNERS, (len(self), 8, 3))
        return node_places()[self.kinds]

    @property
    def hangs(self) -> NDArray[np.bool_] | None:
        """Which elements (c,) of a mixed mesh have hanging corners; else None."""
        return None if self.kinds is None else (self.kinds != WHOLE) & (self.kinds % 256 != 0)

    def stiffness(self, chosen: Chosen = slice(None)) -> Array:
        """Element stiffness matrices (c, 24, 24) [N/m] of the chosen elements."""
        kernels = quadrature_stiffness(self.poisson).reshape(8, 576)
        stiffness = (self.edge * (self.young[chosen] @ kernels)).reshape(-1, 24, 24)
        if self.kinds is None:
            return stiffness
        kinds = self.kinds[chosen]
        stiffness *= np.where(kinds == WHOLE, 2.0, 1.0)[:, None, None]
        hangs, weights = _at_hanging_corners(kinds)
        if len(hangs):
            weights = np.einsum("cka,ij->ckiaj", weights, np.eye(3)).reshape(-1, 24, 24)
            stiffness[hangs] = weights.transpose(0, 2, 1) @ stiffness[hangs] @ weights
        return stiffness

    def nodal_mass(self, chosen: Chosen = slice(None)) -> Array:
        """Element masses (c, 8, 8) [kg] between corners, the same for each displacement component.

        The trilinear shape functions are integrated over the filled octants: P^T M P of the fine
        cells that a coarse cell stands for, and the consistent mass of a fine cell. Nodes of cells
        with hanging corners take what is theirs of it.
        """
        octants = np.unpackbits(self.fill[chosen][:, None], axis=1, bitorder="little")
        scale = self.density * (self.edge / 2.0) ** 3
        mass = (scale * octants @ coarse_cell_mass().reshape(8, 64)).reshape(-1, 8, 8)
        filled = self.fill[chosen] == ALL_FILLED
        if self.kinds is not None:
            kinds = self.kinds[chosen]
            filled &= kinds == WHOLE
            mass *= np.where(kinds == WHOLE, 8.0, 1.0)[:, None, None]
            hangs, weights = _at_hanging_corners(kinds)
            mass[hangs] = weights.transpose(0, 2, 1) @ mass[hangs] @ weights
        if not (self.lumped or self.lumped_share):
            return np.asarray(mass)
        share = np.where(filled, self.lumped_share, 0.0)
        if self.lumped:
            share[:] = 1.0
        lumped = mass.sum(axis=2)[:, :, None] * np.eye(8)
        return np.asarray(mass + share[:, None, None] * (lumped - mass))


def _at_hanging_corners(kinds: NDArray[np.int32]) -> tuple[NDArray[np.int64], Array]:
    """Elements (h,) with hanging corners, and the weights (h, 8, 8) of their nodes there."""
    hangs = np.flatnonzero((kinds != WHOLE) & (kinds % 256 != 0))
    return hangs, node_weights()[kinds[hangs]]


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
        A mixture disperses less than either (`dataset_gen.objectives.lumped_share`). In a mixed
        mesh the mass of fine cells has none.
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
            self.mesh.kinds,
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
        octants = np.unpackbits(self.fill[:, None], axis=1).sum(axis=1, dtype=int)
        if self.mesh.span is not None:
            octants = octants * self.mesh.span.astype(int) ** 3
        return float(octants.sum() * self.density * (self.mesh.edge / 2.0) ** 3)


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
