"""Kinks of displacements where two materials meet inside a cell.

Strains jump at the border of two materials, which one polynomial does not follow: a cell with both
is too stiff by a share of its volume. So its displacements get parts that have opposite slopes on
the two sides of the border: the distance from it times polynomials, in the three directions. Their
strains are those that polynomials do not have: what is nearest to them of a polynomial is taken
off, so that stresses which are polynomials do no work on kinks, whatever neighbours do (enhanced
strains; Simo and Rifai 1990, of interfaces Moes et al. 2003). They are of the cell alone, and
follow its nodes as the static equilibrium of the materials as they are in tables says, as far as
these differ. So the stiffness stays linear in factors of the moduli.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Flags, Index
from carillon.fem.element import strain_displacement
from carillon.fem.finite_cells.basis import basis, polynomials_of_degree, powers
from carillon.fem.regions import RegionOf, Regions

ALONG_ALONE = np.array([[0, 0, 0], [0, 1, 0], [0, 0, 1]])
POWERS = {2: ALONG_ALONE, 4: powers(2)}
"""Powers (f, 3) of the coordinates across the border and along it in the polynomials that the
distance is multiplied by, by the degree of the cells."""
TAKEN = {2: 0, 4: 3}
"""Degree of the polynomials that are taken off strains, likewise."""
AT_ONCE = 16
"""Cells whose kinks are computed together; each takes 2 megabytes."""
SMALLEST = 1e-4
"""Share of a cell's inside below which the smaller part has no kink."""
SOFTEST = 1e-7
"""Share of the kinks' largest stiffness that is added, for those that hardly strain anything."""
ALIKE = 1e-7
"""Energy, over the largest, below which polynomials are the same inside a cell: what is taken off
rests on differences of large numbers where little of it is inside."""


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
        """Borders that are `chosen` (k,), between the regions of new numbers `region` (k, 2)."""
        arrays = (getattr(self, name)[chosen] for name in ("cell", "place", "normal", "share"))
        cell, place, normal, share = arrays
        return Borders(cell, region[chosen].astype(np.uint16), place, normal, share)

    @classmethod
    def nothing(cls) -> Borders:
        """No borders."""
        none, pairs = np.empty(0, dtype=np.int64), np.empty((0, 2))
        return cls(none, pairs.astype(np.uint16), np.empty((0, 3)), np.empty((0, 3)), pairs)

    def strains(self, degree: int, chosen: Index) -> Array:
        """Strains (c, 2, d, 6, f) of the kinks at a cell's points, on either side, for edges of 1.

        `degree` is that of the cells. Nothing is taken off them.
        """
        points, factors = basis(degree).points, POWERS[degree]
        normal = self.normal[chosen]
        axes = np.concatenate([normal[:, :, None], _across(normal)], axis=2)
        local = np.einsum("cpi,cik->cpk", points[None] - self.place[chosen, None], axes)
        exponents = factors + np.array([1, 0, 0])
        gradients = np.empty((*local.shape[:2], len(factors), 3))
        for axis in range(3):
            lower = exponents.copy()
            lower[:, axis] = np.maximum(lower[:, axis] - 1, 0)
            terms = (local[:, :, None] ** lower).prod(axis=3)
            gradients[..., axis] = exponents[:, axis] * terms
        gradients = np.einsum("cpfk,cik->cpfi", gradients, axes)
        slopes = self.share[chosen, ::-1] * np.array([1.0, -1.0])
        sides = slopes[:, :, None, None, None] * gradients[:, None]
        flat = strain_displacement(sides.reshape(-1, *sides.shape[3:]))
        return flat.reshape(*sides.shape[:3], 6, 3 * len(factors))


def _across(normal: Array) -> Array:
    """Two directions (c, 3, 2) across unit vectors (c, 3), and each other."""
    other = np.eye(3)[np.abs(normal).argmin(axis=1)]
    first = np.cross(normal, other)
    first = first / np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(normal, first)], axis=2)


@dataclass(frozen=True, eq=False)
class Kinks:
    """Borders, and how their kinks follow the nodes of the cells."""

    degree: int
    """Degree of the cells' shape functions, see `carillon.fem.finite_cells.basis`."""
    borders: Borders
    regions: Regions
    taken: Array
    """(k, j, 6, f) polynomials that are taken off the strains of the f functions."""
    follow: Array
    """(k, f, 3 n) kinks by displacements of the nodes."""

    @classmethod
    def in_equilibrium(
        cls, degree: int, borders: Borders, regions: Regions, inside: Array
    ) -> Kinks:
        """Kinks without load on them, of regions as they are in tables.

        `inside` (k, 2, d) are the weights of the two sides.
        """
        count, functions = len(borders), 3 * len(POWERS[degree])
        polynomials = _polynomials(degree)
        taken = np.empty((count, polynomials.shape[1], 6, functions))
        follow = np.zeros((count, functions, 3 * basis(degree).n_nodes))
        kinks = cls(degree, borders, regions, taken, follow)
        for first in range(0, count, AT_ONCE):
            few = np.arange(first, min(first + AT_ONCE, count))
            taken[few] = _nearest(polynomials, inside[few], borders.strains(degree, few))
            strains = kinks.strains(few)
            laws = kinks._laws(few)
            own = _work(strains, _stress(laws, inside[few], strains))
            # Without a jump there is no kink, whatever the cell's strains.
            share = borders.share[few, 1, None, None]
            laws = laws - (laws[:, 0] + share * (laws[:, 1] - laws[:, 0]))[:, None]
            coupling = kinks._with_nodes(_stress(laws, inside[few], strains))
            least = SOFTEST * np.einsum("kii->k", own) / functions
            own = own + least[:, None, None] * np.eye(functions)
            follow[few] = -np.linalg.solve(own, coupling)
        return kinks

    def add_stiffness(self, chosen: Index, moduli: Array, matrices: Array) -> None:
        """Add what kinks change to stiffness matrices (c, 3 n, 3 n) of their cells of edge one.

        `moduli` (c, 2, d) [Pa] are weighted ones of the two sides.
        """
        for first in range(0, len(chosen), AT_ONCE):
            few = slice(first, first + AT_ONCE)
            strains = self.strains(chosen[few])
            laws = self.regions.elasticity[self.borders.region[chosen[few]]]
            stress = _stress(laws, moduli[few], strains)
            follow = self.follow[chosen[few]]
            turned = follow.transpose(0, 2, 1)
            mixed = turned @ self._with_nodes(stress)
            own = _work(strains, stress)
            matrices[few] += mixed + mixed.transpose(0, 2, 1) + turned @ own @ follow

    def strains(self, chosen: Index) -> Array:
        """Strains (c, 2, d, 6, f) of the kinks at the points, on either side."""
        polynomials = _polynomials(self.degree)
        taken = np.tensordot(self.taken[chosen], polynomials, axes=(1, 1))
        strains = self.borders.strains(self.degree, chosen)
        strains -= taken.transpose(0, 3, 1, 2)[:, None]
        return strains

    def whole_strains(self, number: int, side: int) -> Array:
        """Strains (d, 6, 3 n) at the points on one side of a cell, by displacements of the nodes.

        Kinks are in them.
        """
        strains = self.strains(np.array([number]))[0, side]
        return np.asarray(self._nodes + strains @ self.follow[number])

    def _laws(self, chosen: Index) -> Array:
        """Elasticity (c, 2, 6, 6) [Pa] of the two sides as it is in tables."""
        region = self.borders.region[chosen]
        return np.asarray(
            self.regions.young[region][..., None, None] * self.regions.elasticity[region]
        )

    def _with_nodes(self, stress: Array) -> Array:
        """Work (c, f, 3 n) of stresses (c, 2, d, 6, f) on strains by nodes."""
        summed = stress.sum(axis=1).reshape(len(stress), -1, stress.shape[-1])
        return np.asarray(summed.transpose(0, 2, 1) @ self._nodes.reshape(-1, self._nodes.shape[2]))

    @cached_property
    def _nodes(self) -> Array:
        """Strains (d, 6, 3 n) by displacements of the nodes."""
        shape = basis(self.degree)
        return strain_displacement(shape.gradients(shape.points))


def _polynomials(degree: int) -> Array:
    """Polynomials (d, j) that are taken off, at the points of cells of this degree."""
    return polynomials_of_degree(TAKEN[degree], basis(degree).points)


def _nearest(polynomials: Array, inside: Array, strains: Array) -> Array:
    """Polynomials (c, j, 6, f) that are nearest to strains (c, 2, d, 6, f) inside the cells.

    `polynomials` (d, j) are their values at the points, `inside` (c, 2, d) the weights.
    """
    grams = np.einsum("cp,pi,pj->cij", inside.sum(axis=1), polynomials, polynomials, optimize=True)
    weighted = (inside[:, :, :, None, None] * strains).sum(axis=1)
    right = polynomials.T @ weighted.reshape(*weighted.shape[:2], -1)
    found = np.linalg.pinv(grams, ALIKE, hermitian=True) @ right
    return np.asarray(found).reshape(len(found), -1, *strains.shape[3:])


def _stress(laws: Array, weights: Array, strains: Array) -> Array:
    """Weighted stresses (c, 2, d, 6, f) of strains, by elasticities (c, 2, 6, 6)."""
    stress = laws[:, :, None] @ strains
    stress *= weights[..., None, None]
    return np.asarray(stress)


def _work(strains: Array, stress: Array) -> Array:
    """Work (c, f, f) of stresses on strains."""
    count, functions = len(strains), strains.shape[-1]
    flat = strains.reshape(count, -1, functions).transpose(0, 2, 1)
    return np.asarray(flat @ stress.reshape(count, -1, functions))
