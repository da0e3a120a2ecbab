"""Parts too small to be cells of their own, which neighbours take in.

Where lines of the lattice meet little of a cell, its points are too few to tell motions with strain
from those without, and it would move slowly by itself as no solid does. A neighbour's displacements
go on into such a part instead (aggregated finite elements, Badia, Verdugo and Martin 2018): the
integrals over it are added to the neighbour's, of whose polynomials nothing is lost.
"""

import numpy as np

from carillon.arrays import Array, Flags, Index
from carillon.fem.element import CORNERS
from carillon.fem.finite_cells.joining import Faces
from carillon.fem.finite_cells.shapes import OCTANTS, POINTS, points, polynomials

FARTHEST = 3
"""Cells away from a part that one may be that takes it in."""


def hosts(faces: Faces, slight: Flags, volumes: Array) -> Index:
    """Part (p,) that takes each in: itself unless it is slight, -1 where there is none.

    It is the largest among the neighbours, or that takes in a neighbour.
    """
    host = np.where(slight, -1, np.arange(len(slight)))
    pairs = np.concatenate([faces.alike[:, :2], faces.unlike[:, :2]])
    pairs = np.concatenate([pairs, pairs[:, ::-1]])
    for _ in range(FARTHEST):
        own, other = pairs[(host[pairs[:, 0]] < 0) & (host[pairs[:, 1]] >= 0)].T
        order = np.argsort(volumes[host[other]], kind="stable")
        host[own[order]] = host[other[order]]
    return host


def taken_in(
    corner: Index, span: Index, host: Index, row: Index, weights: Array
) -> tuple[Index, Array]:
    """Rows (p,) of the parts and the weights (k, 8, 125) with what hosts have taken in.

    `corner` (p, 3) and `span` (p,) are lowest corners and edges of the cells; see `hosts`, and
    of `row` and `weights` `carillon.fem.finite_cells.cells.FiniteCells`.
    """
    guests = np.flatnonzero((host >= 0) & (host != np.arange(len(host))))
    if not len(guests):
        return row, weights
    to = host[guests]
    scale = (span[guests] / span[to])[:, None]
    offset = (corner[guests] - corner[to]) / span[to][:, None]
    places = offset[:, None] + scale[:, None] * points()
    values = polynomials(places.reshape(-1, 3)).reshape(len(guests), POINTS, POINTS)
    moved = scale[:, :, None] ** 3 * (weights[row[guests]] @ values)
    taking, which = np.unique(to, return_inverse=True)
    total = weights[row[taking]]
    filled = (total.sum(axis=2) > 0.0)[which]
    middles = offset[:, None] + scale[:, None] * (CORNERS + 0.5) / 2.0
    for octant in range(OCTANTS):
        # The material of the nearest octant that the host has.
        far = ((middles[:, octant, None] - (CORNERS + 0.5) / 2.0) ** 2).sum(axis=2)
        nearest = np.where(filled, far, np.inf).argmin(axis=1)
        np.add.at(total, (which, nearest), moved[:, octant])
    row = row.copy()
    row[taking] = len(weights) + np.arange(len(taking))
    return row, np.concatenate([weights, total])
