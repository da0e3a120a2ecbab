"""Elements with material, wherever their nodes are: what the matrices are summed from."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self, cast

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Flags, Index
from carillon.fem.block import ALL_FILLED, coarse_cell_mass
from carillon.fem.element import (
    CORNERS,
    elasticity_stiffness,
    quadrature_stiffness,
    shape_functions,
)
from carillon.fem.geometry.hanging import WHOLE, node_places, node_weights
from carillon.fem.regions import RegionOf, Regions
from carillon.fem.supports import Attached

Chosen = NDArray[np.integer] | Flags | slice

MOST_LAWS = 16
"""Most elasticities whose kernels are put side by side; of more, matrices are summed by entries."""


class Elements(ABC):
    """Elements of one kind, all of whose arrays have a row for each."""

    young: Array
    """Moduli [Pa] at the points of each element, which its stiffness is linear in."""
    edge: float
    """Spacing of the lattice that the nodes lie on [m]."""
    regions: Regions
    """Materials that there are."""
    support: NDArray[np.int32] | None
    """(c,) numbers of the elements in `attached`, -1 of those without supports; None of a free
    solid."""
    attached: Attached | None
    """What supports the solid, in all of its elements."""
    ROWS: ClassVar[tuple[str, ...]]
    """Names of the arrays with a row for each element, some of which may be None."""

    @property
    @abstractmethod
    def node_places(self) -> Index:
        """Places (c, k, 3) of the nodes about a point of each element, in edges."""

    @property
    @abstractmethod
    def steps(self) -> int | None:
        """Edges along an element: planes of the lattice that far apart separate elements.

        None of elements of several sizes, which some of any planes pass through.
        """

    @property
    @abstractmethod
    def sort_key(self) -> NDArray[np.integer]:
        """What (c,) tells elements with the same nodes apart."""

    def arrays(self) -> list[NDArray[Any]]:
        """What differs from element to element: the arguments of `of`."""
        return [getattr(self, name) for name in self._rows()]

    def of(self, *arrays: NDArray[Any]) -> Self:
        """Other elements of the same solid."""
        changed: dict[str, Any] = dict(zip(self._rows(), arrays, strict=True))
        return replace(cast(Any, self), **changed)  # Every kind is a dataclass.

    def _rows(self) -> list[str]:
        return [name for name in self.ROWS if getattr(self, name) is not None]

    def stiffness(self, chosen: Chosen = slice(None)) -> Array:
        """Element stiffness matrices (c, 3 k, 3 k) [N/m] of the chosen elements."""
        matrices = self.free_stiffness(chosen)
        if self.attached is not None and self.support is not None:
            self.attached.add_stiffness(self.support[chosen], matrices)
        return matrices

    def nodal_mass(self, chosen: Chosen = slice(None)) -> Array:
        """Element masses (c, k, k) [kg] between nodes, the same for each component."""
        matrices = self._nodal_mass(chosen)
        if self.attached is not None and self.support is not None:
            self.attached.add_mass(self.support[chosen], matrices)
        return matrices

    @abstractmethod
    def moduli_of(self, chosen: Flags) -> Array:
        """Moduli like `young` at the points of chosen regions (r,), 0 at others."""

    @abstractmethod
    def free_stiffness(self, chosen: Chosen = slice(None)) -> Array:
        """Stiffness (c, 3 k, 3 k) [N/m] without supports."""

    @abstractmethod
    def _nodal_mass(self, chosen: Chosen) -> Array:
        """Mass without supports."""

    @abstractmethod
    def shape_values(self, elements: NDArray[np.integer], places: Array) -> Array:
        """Weights (p, k) of the nodes of `elements` (p,) at places (p, 3) in them, from 0 to 1.

        Beside them those of the nearest place, or what goes on from there.
        """

    def with_young(self, young: Array) -> Self:
        """The same elements with other moduli."""
        return self.of(young, *self.arrays()[1:])

    def with_regions(self, regions: Regions) -> Self:
        """The same elements of other materials."""
        return replace(cast(Any, self), regions=regions)

    def __len__(self) -> int:
        return len(self.young)


@dataclass(frozen=True)
class HexElements(Elements):
    """Cubic elements with material, wherever their nodes may be; see `ElasticModel`."""

    ROWS = ("young", "fill", "kinds", "region", "support")

    young: Array
    """(c, 8) at the quadrature points."""
    fill: NDArray[np.uint8]
    edge: float
    """Edge of an element [m], of the smaller ones in a mixed mesh."""
    regions: Regions
    lumped: bool = False
    lumped_share: float = 0.0
    kinds: NDArray[np.int32] | None = None
    """(c,) int32: kinds of the elements of a mixed mesh, see `carillon.fem.geometry.hanging`; else
    None."""
    region: RegionOf | None = None
    """(c, 8) region of each octant and of the point in it; None if there is one."""
    support: NDArray[np.int32] | None = None
    attached: Attached | None = None

    @property
    def steps(self) -> int | None:
        return 1 if self.kinds is None else None

    @property
    def node_places(self) -> Index:
        if self.kinds is None:
            return np.broadcast_to(CORNERS, (len(self), 8, 3))
        return node_places()[self.kinds]

    @property
    def sort_key(self) -> NDArray[np.uint8]:
        return self.fill

    def shape_values(self, elements: NDArray[np.integer], places: Array) -> Array:
        """Trilinear weights (p, 8); what a hanging corner says is the nodes' that it hangs from."""
        weights = shape_functions(np.clip(places, 0.0, 1.0))
        if self.kinds is None:
            return weights
        return np.einsum("pk,pkj->pj", weights, node_weights()[self.kinds[elements]])

    def moduli_of(self, chosen: Flags) -> Array:
        there = chosen[0] if self.region is None else chosen[self.region]
        return np.asarray(np.where(there, self.young, 0.0))

    def free_stiffness(self, chosen: Chosen = slice(None)) -> Array:
        stiffness = self._uniform_edges(chosen)
        if self.kinds is None:
            return stiffness
        kinds = self.kinds[chosen]
        stiffness *= np.where(kinds == WHOLE, 2.0, 1.0)[:, None, None]
        hangs, weights = _at_hanging_corners(kinds)
        if len(hangs):
            weights = np.einsum("cka,ij->ckiaj", weights, np.eye(3)).reshape(-1, 24, 24)
            stiffness[hangs] = weights.transpose(0, 2, 1) @ stiffness[hangs] @ weights
        return stiffness

    def _uniform_edges(self, chosen: Chosen) -> Array:
        """Stiffness (c, 24, 24) as if all elements had the smaller edge."""
        young, laws = self.young[chosen], self.regions.laws
        if self.region is None:
            kernels = quadrature_stiffness(laws[0]).reshape(8, 576)
            return (self.edge * (young @ kernels)).reshape(-1, 24, 24)
        present, law = np.unique(self.region[chosen], return_inverse=True)
        law = law.reshape(young.shape)
        if len(present) > MOST_LAWS:
            entries = young[:, :, None, None] * self.regions.elasticity[present][law]
            summed = entries.reshape(len(young), -1) @ elasticity_stiffness()
            return (self.edge * summed).reshape(-1, 24, 24)
        kernels = np.concatenate([quadrature_stiffness(laws[each]) for each in present])
        moduli = np.zeros((len(young), len(present), 8))
        np.put_along_axis(moduli, law[:, None], young[:, None], axis=1)
        summed = moduli.reshape(len(young), -1) @ kernels.reshape(-1, 576)
        return (self.edge * summed).reshape(-1, 24, 24)

    def _nodal_mass(self, chosen: Chosen) -> Array:
        """Element masses (c, 8, 8) [kg] between corners, the same for each displacement component.

        The trilinear shape functions are integrated over the filled octants: P^T M P of the fine
        cells that a coarse cell stands for, and the consistent mass of a fine cell. Nodes of cells
        with hanging corners take what is theirs of it.
        """
        octants = np.unpackbits(self.fill[chosen][:, None], axis=1, bitorder="little")
        density = self.regions.density[0 if self.region is None else self.region[chosen]]
        scale = density * (self.edge / 2.0) ** 3
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
