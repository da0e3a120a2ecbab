"""Shape functions of finite cells of degree 2 and 4, and the points that their integrals rest on.

Cells of degree 2 have all 27 products of quadratic polynomials, in files of older versions. Those
of degree 4 have the trunk space (serendipity; Arnold and Awanou 2011): products of which the
degrees above one add up to four at most, 50 of them, with nodes at the corners, three on each edge
and one in the middle of each face.

Products of two shape functions, or of two of their gradients, span a space of polynomials with a
dimension of 125 or 295. Integrals of these over any part of the cell follow from the values at as
many points; the weights are the integrals of the points' Lagrange polynomials over that part, which
are its moments in another basis.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from itertools import product

import numpy as np

from carillon.arrays import Array, Index, frozen

DEGREE = 4
"""Degree of new cells."""
DEGREES = (2, 4)
"""Degrees that cells may have; 2 in files of older versions."""
_ORDERS = {2: (0, 1, 2, 3, 4), 4: (4, 0, 8, 2, 6, 3, 7, 1, 5)}
"""Order of the Gauss points on an edge: first ones of these are far apart (Leja), so that products
of as many of them as a space has degrees are well-conditioned places for its polynomials."""


def lagrange(nodes: Array, at: Array) -> Array:
    """Lagrange polynomials (p, n) of the `nodes` (n,) at places (p,)."""
    values = np.ones((len(at), len(nodes)))
    for i, node in enumerate(nodes):
        for other in np.delete(nodes, i):
            values[:, i] *= (at - other) / (node - other)
    return values


@dataclass(frozen=True, eq=False)
class Basis:
    """Shape functions of a cell of edge one, and the points of its integrals."""

    degree: int
    nodes: Index
    """(n, 3) places of the nodes in steps of an edge over `degree`, x fastest."""
    degrees: Index
    """(n, 3) degrees of the products of Legendre polynomials that span the shape functions."""
    point_degrees: Index
    """(d, 3) those that span products of two of them."""
    lines: Array
    """(2 degree + 1,) Gauss points on an edge from 0 to 1."""
    points: Array
    """(d, 3) points of the integrals."""

    @cached_property
    def n_nodes(self) -> int:
        """Nodes of a cell."""
        return len(self.nodes)

    @cached_property
    def n_points(self) -> int:
        """Points of its integrals."""
        return len(self.points)

    def products(self, places: Array) -> Array:
        """Products (p, n) of Legendre polynomials, of `degrees`, at `places` (p, 3)."""
        return _legendre(self.degrees, places)

    def functions(self, places: Array) -> Array:
        """Shape functions (p, n) at `places` (p, 3) in the cell, or beside it."""
        return _legendre(self.degrees, places) @ self._coefficients

    def gradients(self, places: Array) -> Array:
        """Their gradients (p, n, 3)."""
        slopes = [_legendre(self.degrees, places, axis) @ self._coefficients for axis in range(3)]
        return np.stack(slopes, axis=2)

    def polynomials(self, places: Array) -> Array:
        """Lagrange polynomials (p, d) of the points at `places` (p, 3) in the cell or beside it."""
        return _legendre(self.point_degrees, places) @ self._of_points

    @cached_property
    def _coefficients(self) -> Array:
        return np.linalg.inv(_legendre(self.degrees, self.nodes / self.degree))

    @cached_property
    def _of_points(self) -> Array:
        return np.linalg.inv(_legendre(self.point_degrees, self.points))

    @cached_property
    def line_points(self) -> Array:
        """Products (q^3, 3) of the points on lines, x fastest."""
        z, y, x = np.meshgrid(self.lines, self.lines, self.lines, indexing="ij")
        return frozen(np.stack([x, y, z], axis=-1).reshape(-1, 3))

    def line_polynomials(self, places: Array) -> Array:
        """Lagrange polynomials (p, q^3) of `line_points` at `places` (p, 3)."""
        x, y, z = (lagrange(self.lines, places[:, axis]) for axis in range(3))
        return np.asarray(np.einsum("pk,pj,pi->pkji", z, y, x).reshape(len(places), -1))

    @cached_property
    def from_lines(self) -> Array:
        """Weights of the points (q^3, d) by those of `line_points`."""
        return frozen(self.polynomials(self.line_points))

    def line_box(self, low: Array, high: Array) -> Array:
        """Weights (k, q^3) of `line_points` for boxes with these corners (k, 3), see `box`."""
        places, shares = np.polynomial.legendre.leggauss(self.degree + 1)
        factors = []
        for axis in range(3):
            start, edge = low[:, axis, None], (high - low)[:, axis, None]
            at = start + edge * (places + 1.0) / 2.0
            values = lagrange(self.lines, at.ravel()).reshape(*at.shape, -1)
            factors.append(0.5 * edge * np.einsum("g,kgq->kq", shares, values))
        x, y, z = factors
        return np.asarray(np.einsum("kc,kb,ka->kcba", z, y, x).reshape(len(low), -1))

    def box(self, low: Array, high: Array) -> Array:
        """Weights (k, d) of boxes with these corners (k, 3), for a cell of volume one."""
        return np.asarray(self.line_box(low, high) @ self.from_lines)

    @cached_property
    def whole(self) -> Array:
        """(d,) weights of the whole cell."""
        return frozen(self.box(np.zeros((1, 3)), np.ones((1, 3)))[0])

    def voxels(self, count: int) -> Array:
        """Weights (count^3, d) of the voxels of a cell that has `count` along an edge, x fastest.

        Examples
        --------
        >>> bool(abs(basis(4).voxels(2).sum(axis=1) - 0.125).max() < 1e-12)
        True
        """
        low = voxel_places(count) / count
        return self.box(low, low + 1.0 / count)

    def line_voxels(self, count: int) -> Array:
        """Weights (count^3, q^3) of `line_points` for the voxels of `voxels`."""
        low = voxel_places(count) / count
        return self.line_box(low, low + 1.0 / count)

    @cached_property
    def faces(self) -> Index:
        """(6, f) nodes of the faces at -x, x, -y, y, -z, z, in one order of places on them."""
        found = []
        for axis, side in product(range(3), (0, self.degree)):
            slots = np.flatnonzero(self.nodes[:, axis] == side)
            across = np.delete(self.nodes[slots], axis, axis=1)
            found.append(slots[np.lexsort(across.T)])
        return np.array(found)

    @cached_property
    def corners(self) -> Index:
        """(8,) nodes at the corners, in bit order."""
        places = self.degree * voxel_places(2)
        same = (self.nodes[None] == places[:, None]).all(axis=2)
        return np.asarray(same.argmax(axis=1))

    @cached_property
    def middles(self) -> Index:
        """(6,) nodes in the middles of the faces."""
        half = self.degree // 2
        across = (self.nodes[self.faces] == half).sum(axis=2) == 2
        return np.asarray(self.faces[np.arange(6), across.argmax(axis=1)])


@cache
def basis(degree: int = DEGREE) -> Basis:
    """The shape functions of cells of this degree.

    Examples
    --------
    >>> quartic = basis(4)
    >>> quartic.n_nodes, quartic.n_points, quartic.faces.shape
    (50, 295, (6, 17))
    >>> at_nodes = quartic.functions(quartic.nodes / 4.0)
    >>> bool(abs(at_nodes - np.eye(50)).max() < 1e-10)
    True
    """
    every = np.array([place[::-1] for place in product(range(degree + 1), repeat=3)])
    inner = (every > 0) & (every < degree)
    if degree == 2:
        degrees, nodes = every, every
    else:
        degrees = every[(np.where(every > 1, every, 0).sum(axis=1)) <= degree]
        in_middle = np.where(inner, every == degree // 2, True).all(axis=1)
        nodes = every[(inner.sum(axis=1) <= 1) | ((inner.sum(axis=1) == 2) & in_middle)]
    sums = np.unique((degrees[:, None] + degrees[None]).reshape(-1, 3)[:, ::-1], axis=0)[:, ::-1]
    lines = 0.5 + 0.5 * np.polynomial.legendre.leggauss(2 * degree + 1)[0]
    points = lines[np.array(_ORDERS[degree])[sums]]
    return Basis(
        degree, frozen(nodes), frozen(degrees), frozen(sums), frozen(lines), frozen(points)
    )


def voxel_places(count: int) -> Index:
    """Places (count^3, 3) of the voxels along the edges of a cell, x fastest."""
    return np.array([place[::-1] for place in product(range(count), repeat=3)])


def powers(degree: int) -> Index:
    """Powers (k, 3) of the coordinates in polynomials of up to a degree, the lowest first.

    Examples
    --------
    >>> powers(1).tolist()
    [[0, 0, 0], [0, 0, 1], [0, 1, 0], [1, 0, 0]]
    """
    every = np.array(list(product(range(degree + 1), repeat=3)))
    every = every[every.sum(axis=1) <= degree]
    return np.asarray(every[np.argsort(every.sum(axis=1), kind="stable")])


def polynomials_of_degree(degree: int, places: Array) -> Array:
    """A basis (p, k) of the polynomials of up to a degree at `places` (p, 3) in a cell."""
    return _legendre(powers(degree), places)


def _legendre(degrees: Index, places: Array, along: int | None = None) -> Array:
    """Products (p, k) of Legendre polynomials of degrees (k, 3) on [0, 1] at places (p, 3).

    Of the axis `along`, if there is one, it is their derivatives.
    """
    result = np.ones((len(places), len(degrees)))
    for axis in range(3):
        values = np.polynomial.legendre.legvander(2.0 * places[:, axis] - 1.0, degrees.max())
        if axis == along:
            eye = np.eye(degrees.max() + 1)
            slopes = np.polynomial.legendre.legder(eye)
            values = 2.0 * values[:, : len(slopes)] @ slopes
        result *= values[:, degrees[:, axis]]
    return result
