"""Elements with material, wherever their nodes are: what the matrices are summed from."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Any, Self, cast

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Flags, Index
from carillon.fem.block import ALL_FILLED, coarse_cell_mass
from carillon.fem.element import CORNERS, quadrature_stiffness
from carillon.fem.geometry.hanging import WHOLE, node_places, node_weights

Chosen = NDArray[np.integer] | Flags | slice


class Elements(ABC):
    """Elements of one kind, all of whose arrays have a row for each."""

    young: Array
    """(c, p) moduli [Pa] at the points of each element, which its stiffness is linear in."""
    edge: float
    """Spacing of the lattice that the nodes lie on [m]."""
    poisson: float

    @property
    @abstractmethod
    def node_places(self) -> Index:
        """Places (c, k, 3) of the nodes about a point of each element, in edges."""

    @property
    @abstractmethod
    def steps(self) -> int:
        """Edges along an element: planes of the lattice that far apart separate elements."""

    @property
    @abstractmethod
    def collinear(self) -> Flags | None:
        """Which elements (c,) may have three nodes on a line; None if none has."""

    @property
    @abstractmethod
    def sort_key(self) -> NDArray[np.integer]:
        """What (c,) tells elements with the same nodes apart."""

    @abstractmethod
    def arrays(self) -> list[NDArray[Any]]:
        """What differs from element to element: the arguments of `of`."""

    @abstractmethod
    def of(self, *arrays: NDArray[Any]) -> Self:
        """Other elements of the same solid."""

    @abstractmethod
    def stiffness(self, chosen: Chosen = slice(None)) -> Array:
        """Element stiffness matrices (c, 3 k, 3 k) [N/m] of the chosen elements."""

    @abstractmethod
    def nodal_mass(self, chosen: Chosen = slice(None)) -> Array:
        """Element masses (c, k, k) [kg] between nodes, the same for each component."""

    def with_young(self, young: Array) -> Self:
        """The same elements with other moduli."""
        return self.of(young, *self.arrays()[1:])

    def with_poisson(self, poisson: float) -> Self:
        """The same elements with another Poisson's ratio."""
        return replace(cast(Any, self), poisson=poisson)  # Every kind is a dataclass.

    def __len__(self) -> int:
        return len(self.young)


@dataclass(frozen=True)
class HexElements(Elements):
    """Cubic elements with material, wherever their nodes may be; see `ElasticModel`."""

    young: Array
    fill: NDArray[np.uint8]
    edge: float
    """Edge of an element [m], of the smaller ones in a mixed mesh."""
    poisson: float
    density: float
    lumped: bool
    lumped_share: float
    kinds: NDArray[np.int32] | None = None
    """(c,) int32: kinds of the elements of a mixed mesh, see `carillon.fem.geometry.hanging`; else
    None."""

    def of(self, *arrays: NDArray[Any]) -> Self:
        young, fill, *kinds = arrays
        return replace(self, young=young, fill=fill, kinds=kinds[0] if kinds else None)

    def arrays(self) -> list[NDArray[Any]]:
        kinds = [] if self.kinds is None else [self.kinds]
        return [self.young, self.fill, *kinds]

    @property
    def steps(self) -> int:
        return 1 if self.kinds is None else 2

    @property
    def node_places(self) -> Index:
        if self.kinds is None:
            return np.broadcast_to(CORNERS, (len(self), 8, 3))
        return node_places()[self.kinds]

    @property
    def collinear(self) -> Flags | None:
        return None if self.kinds is None else (self.kinds != WHOLE) & (self.kinds % 256 != 0)

    @property
    def sort_key(self) -> NDArray[np.uint8]:
        return self.fill

    def stiffness(self, chosen: Chosen = slice(None)) -> Array:
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


def _at_hanging_corners(kinds: NDArray[np.int32]) -> tuple[Index, Array]:
    """Elements (h,) with hanging corners, and the weights (h, 8, 8) of their nodes there."""
    hangs = np.flatnonzero((kinds != WHOLE) & (kinds % 256 != 0))
    return hangs, node_weights()[kinds[hangs]]
