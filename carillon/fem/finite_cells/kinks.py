"""Kinks of displacements where two materials meet inside a cell.

Strains jump at the border of two materials, which one polynomial does not follow: a cell with both
is too stiff by a share of its volume. So its displacements get a part that is linear on either side
of the border, of opposite slopes, and zero on average: nine functions, in the three directions each
constant and linear along the border. They are of the cell alone (incompatible modes; Wilson et al.
1973, of interfaces Moes et al. 2003) and follow its nodes as the static equilibrium of the
materials as they are in tables says, as far as these differ. So the stiffness stays linear in
factors of the moduli.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Flags, Index
from carillon.fem.element import strain_displacement
from carillon.fem.finite_cells.shapes import POINTS, points, shape_gradients
from carillon.fem.regions import RegionOf, Regions

FUNCTIONS = 9
"""Three along each axis."""
AT_ONCE = 128
"""Cells whose kinks are computed together; each takes a quarter of a megabyte."""
SMALLEST = 1e-4
"""Share of a cell's inside below which the smaller part has no kink."""
SOFTEST = 1e-10
"""Share of the kinks' largest stiffness that is added, for those that hardly strain anything."""


@dataclass(frozen=True, eq=False)
class Borders:
    """Cells of two materials, with the plane that divides them about."""

    cell: Index
    """(k,)."""
    region: RegionOf
    """(k, 2) on the two sides: first where `normal` comes from."""
    place: Array
    normal: Array
    """(k, 3) a point of the plane, in cells of edge one, and its unit normal."""
    share: Array
    """(k, 2) of the cell's inside that is of each."""

    def __len__(self) -> int:
        return len(self.cell)

    def some(self, chosen: Flags, region: NDArray[np.integer]) -> Borders:
        """Those chosen (k,), with other numbers (k, 2) of their regions."""
        arrays = (getattr(self, name)[chosen] for name in ("cell", "place", "normal", "share"))
        cell, place, normal, share = arrays
        return Borders(cell, region[chosen].astype(np.uint16), place, normal, share)

    @classmethod
    def nothing(cls) -> Borders:
        """No borders."""
        none, pairs = np.empty(0, dtype=np.int64), np.empty((0, 2))
        return cls(none, pairs.astype(np.uint16), np.empty((0, 3)), np.empty((0, 3)), pairs)

    def strains(self, chosen: Index) -> Array:
        """Strains (c, 2, 125, 6, 9) of the kinks at the points, on either side, for a unit edge."""
        normal = self.normal[chosen]
        along = _across(normal)
        offset = points()[None] - self.place[chosen, None]
        height = np.einsum("cpi,ci->cp", offset, normal)
        # Linear functions along the border: one, and two coordinates.
        factors = np.concatenate(
            [np.ones((*height.shape, 1)), np.einsum("cpi,cik->cpk", offset, along)], axis=2
        )
        slopes = self.share[chosen, ::-1] * np.array([1.0, -1.0])
        gradients = np.empty((len(chosen), 2, POINTS, 3, 3))
        for side in range(2):
            slope = slopes[:, side, None, None, None]
            direct = factors[:, :, :, None] * normal[:, None, None, :]
            gradients[:, side] = slope * direct
            lateral = slope[..., 0] * height[:, :, None]
            gradients[:, side, :, 1:] += lateral[..., None] * along.transpose(0, 2, 1)[:, None]
        flat = strain_displacement(gradients.reshape(-1, 3, 3))
        return flat.reshape(len(chosen), 2, POINTS, 6, FUNCTIONS)


def _across(normal: Array) -> Array:
    """Two directions (c, 3, 2) across unit vectors (c, 3), and each other."""
    other = np.eye(3)[np.abs(normal).argmin(axis=1)]
    first = np.cross(normal, other)
    first = first / np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(normal, first)], axis=2)


@dataclass(frozen=True, eq=False)
class Kinks:
    """Borders, and how their kinks follow the nodes of the cells."""

    borders: Borders
    regions: Regions
    mean: Array
    """(k, 6, 9) mean strains of the functions inside the cells, which are taken off: so constant
    stress does no work on kinks (patch test)."""
    follow: Array
    """(k, 9, 81) kinks by displacements of the nodes."""

    @classmethod
    def in_equilibrium(
        cls, borders: Borders, regions: Regions, moduli: Array, inside: Array
    ) -> Kinks:
        """Kinks without load on them, for weighted moduli (k, 2, 125) [Pa] of the two sides.

        `inside` (k, 2, 125) are the weights alone.
        """
        count = len(borders)
        mean, follow = np.empty((count, 6, FUNCTIONS)), np.zeros((count, FUNCTIONS, 81))
        kinks = cls(borders, regions, mean, follow)
        for first in range(0, count, AT_ONCE):
            few = np.arange(first, min(first + AT_ONCE, count))
            strains = np.einsum("crp,crpik->cik", inside[few], borders.strains(few))
            mean[few] = strains / inside[few].sum(axis=(1, 2))[:, None, None]
            own, coupling = kinks._products(few, moduli[few])
            # Without a jump there is no kink, whatever the cell's strains.
            coupling -= kinks._mixed_coupling(few, inside[few])
            least = SOFTEST * np.einsum("kii->k", own) / FUNCTIONS
            own = own + least[:, None, None] * np.eye(FUNCTIONS)
            follow[few] = -np.linalg.solve(own, coupling)
        return kinks

    def add_stiffness(self, chosen: Index, moduli: Array, matrices: Array) -> None:
        """Add what kinks change to stiffness matrices (c, 81, 81) of their cells, for a unit edge.

        `moduli` (c, 2, 125) [Pa] are weighted ones of the two sides.
        """
        for first in range(0, len(chosen), AT_ONCE):
            few = slice(first, first + AT_ONCE)
            own, coupling = self._products(chosen[few], moduli[few])
            follow = self.follow[chosen[few]]
            turned = follow.transpose(0, 2, 1)
            mixed = turned @ coupling
            matrices[few] += mixed + mixed.transpose(0, 2, 1) + turned @ own @ follow

    def strains(self, chosen: Index) -> Array:
        """Strains (c, 2, 125, 6, 9) of the kinks at the points, see `Borders.strains`."""
        return self.borders.strains(chosen) - self.mean[chosen, None, None]

    def whole_strains(self, number: int, side: int) -> Array:
        """Strains (125, 6, 81) at the points on one side of a cell, by displacements of the nodes.

        Kinks are in them.
        """
        strains = self.strains(np.array([number]))[0, side]
        return np.asarray(self._nodes + strains @ self.follow[number])

    def _products(self, chosen: Index, moduli: Array) -> tuple[Array, Array]:
        """Stiffness between kinks (c, 9, 9), and between them and nodes (c, 9, 81)."""
        strains = self.strains(chosen)
        laws = self.regions.elasticity[self.borders.region[chosen]]
        stress = np.einsum("crij,crpjk->crpik", laws, strains) * moduli[..., None, None]
        own = np.einsum("crpik,crpil->ckl", strains, stress, optimize=True)
        return own, self._with_nodes(stress)

    def _mixed_coupling(self, chosen: Index, inside: Array) -> Array:
        """Coupling (c, 9, 81) as if both sides were of the mean of their materials."""
        region, share = self.borders.region[chosen], self.borders.share[chosen]
        own = self.regions.young[region][..., None, None] * self.regions.elasticity[region]
        mean = (share[..., None, None] * own).sum(axis=1)
        strains = self.strains(chosen) * inside[..., None, None]
        return self._with_nodes(np.einsum("cij,crpjk->crpik", mean, strains))

    def _with_nodes(self, stress: Array) -> Array:
        """Work (c, 9, 81) of stresses (c, 2, 125, 6, 9) on strains by nodes."""
        summed = stress.sum(axis=1).reshape(len(stress), -1, FUNCTIONS)
        return np.asarray(summed.transpose(0, 2, 1) @ self._nodes.reshape(-1, 81))

    @cached_property
    def _nodes(self) -> Array:
        """Strains (125, 6, 81) by displacements of the nodes."""
        return strain_displacement(shape_gradients(points()))
