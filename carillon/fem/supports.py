"""Supports of a solid: springs at its points, stiff ones where it is clamped, and point masses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Flags, Index
from carillon.fem.element import rigid_motions

FREE = 1e-9
"""Share of the most that supports resist a rigid motion, each with the same stiffness, below which
it is free."""


@dataclass(frozen=True, eq=False)
class Supports:
    """Springs and masses at points of a solid, in any discretisation."""

    positions: Array
    """(p, 3) where they are [m]."""
    stiffness: Array
    """(p, 3, 3) force [N] by displacement [m]."""
    mass: Array
    """(p,) [kg]."""

    def __len__(self) -> int:
        return len(self.positions)

    @classmethod
    def together(cls, parts: list[Supports]) -> Supports:
        """All of several."""
        names = ("positions", "stiffness", "mass")
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))

    @property
    def holds(self) -> Flags:
        """Which (p,) resist some motion: masses do not."""
        return np.asarray(self.stiffness.any(axis=(1, 2)))

    def free_motions(self, centre: Array, extent: float) -> Array:
        """Rigid motions that nothing resists, (6, r) orthonormal combinations.

        They are of `carillon.fem.element.rigid_motions` about `centre` (3,) [m] in units of
        `extent` [m]. How stiff a spring is does not matter.
        """
        springs = self.stiffness[self.holds]
        if not len(springs):
            return np.eye(6)
        places = (self.positions[self.holds] - centre) / extent
        motions = rigid_motions(places, np.zeros(3)).reshape(-1, 3, 6)
        unit = springs / np.linalg.norm(springs, axis=(1, 2), keepdims=True)
        resistance = np.einsum("pia,pij,pjb->ab", motions, unit, motions)
        values, vectors = np.linalg.eigh(resistance)
        return np.ascontiguousarray(vectors[:, values < FREE * values[-1]])


@dataclass(frozen=True, eq=False)
class Attached:
    """Supports as they act on the nodes of elements."""

    supports: Supports
    """In the order of the elements."""
    start: Index
    """(e + 1,) first support of each element that has some."""
    weights: Array
    """(p, k) of the element's nodes in the displacement at each."""

    @classmethod
    def to_elements(
        cls, supports: Supports, elements: Index, weights: Array, count: int
    ) -> tuple[NDArray[np.int32], Attached]:
        """Numbers (count,) of the elements among those with supports, -1 of others, and these.

        `elements` (p,) are those that the supports act on, by `weights` (p, k) of their nodes.
        """
        order = np.argsort(elements, kind="stable")
        own, start = np.unique(elements[order], return_index=True)
        number = np.full(count, -1, dtype=np.int32)
        number[own] = np.arange(len(own))
        names = ("positions", "stiffness", "mass")
        sorted_ = Supports(*(getattr(supports, name)[order] for name in names))
        return number, cls(sorted_, np.append(start, len(order)), weights[order])

    def add_stiffness(self, number: NDArray[np.int32], matrices: Array) -> None:
        """Add to the stiffness (c, 3 k, 3 k) [N/m] of elements with these numbers (c,)."""
        for element, points in self._of(number):
            weights, springs = self.weights[points], self.supports.stiffness[points]
            for i, j in np.ndindex(3, 3):
                added = (weights * springs[:, i, j, None]).T @ weights
                matrices[element, i::3, j::3] += added

    def add_mass(self, number: NDArray[np.int32], matrices: Array) -> None:
        """Add to the nodal mass (c, k, k) [kg] of elements with these numbers (c,)."""
        if not self.supports.mass.any():
            return
        for element, points in self._of(number):
            weights = self.weights[points]
            matrices[element] += weights.T @ (self.supports.mass[points, None] * weights)

    def _of(self, number: NDArray[np.int32]) -> list[tuple[int, slice]]:
        return [
            (int(element), slice(self.start[number[element]], self.start[number[element] + 1]))
            for element in np.flatnonzero(number >= 0)
        ]
