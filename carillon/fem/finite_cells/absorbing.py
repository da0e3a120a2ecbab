"""Parts too small to be cells of their own, which neighbours take in.

Where lines of the lattice meet little of a cell, its points are too few to tell motions with strain
from those without, and it would move slowly by itself as no solid does. A neighbour's displacements
go on into such a part instead (aggregated finite elements, Badia, Verdugo and Martin 2018): the
integrals over it are added to the neighbour's, of whose polynomials nothing is lost.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array, Flags, Index
from carillon.fem.finite_cells.basis import Basis
from carillon.fem.finite_cells.joining import Faces

FARTHEST = 3
"""Cells away from a part that one may be that takes it in."""


@dataclass(frozen=True, eq=False)
class Held:
    """Portions of voxels that are inside cells: (e,) of them, ordered by cell."""

    cell: Index
    """(e,)."""
    middle: Array
    """(e, 3) of the voxel, in the cell from 0 to 1."""
    row: Index
    """(e,) of the weights."""


def hosts(faces: Faces, slight: Flags, volumes: Array) -> Index:
    """Part (p,) that takes each in: itself unless it is slight, -1 where there is none.

    It is the largest among the neighbours, or that takes in a neighbour.
    """
    host = np.where(slight, -1, np.arange(len(slight)))
    pairs = np.concatenate([faces.pairs, faces.pairs[:, ::-1]])
    for _ in range(FARTHEST):
        own, other = pairs[(host[pairs[:, 0]] < 0) & (host[pairs[:, 1]] >= 0)].T
        order = np.argsort(volumes[host[other]], kind="stable")
        host[own[order]] = host[other[order]]
    return host


def taken_in(
    basis: Basis, corner: Index, span: Index, host: Index, held: Held, weights: Array
) -> tuple[Index, Array]:
    """Rows (e,) and the weights (k, q^3) with what hosts have taken in.

    `corner` (p, 3) and `span` (p,) are lowest corners and edges of the cells; see `hosts`.
    """
    guest = (host >= 0) & (host != np.arange(len(host)))
    own = np.flatnonzero(guest[held.cell])
    if not len(own):
        return held.row, weights
    cell = held.cell[own]
    to = host[cell]
    scale = (span[cell] / span[to])[:, None]
    offset = (corner[cell] - corner[to]) / span[to][:, None]
    moved = np.empty((len(own), weights.shape[1]))
    for number, (shift, factor) in enumerate(zip(offset, scale, strict=True)):
        values = basis.line_polynomials(shift + factor * basis.line_points)
        moved[number] = factor**3 * (weights[held.row[own[number]]] @ values)
    middle = offset + scale * held.middle[own]
    # The material of the nearest voxel that the host has something of.
    first, last = (np.searchsorted(held.cell, to, side=side) for side in ("left", "right"))
    target = np.empty(len(own), dtype=np.int64)
    for number, (begin, end) in enumerate(zip(first, last, strict=True)):
        far = ((held.middle[begin:end] - middle[number]) ** 2).sum(axis=1)
        target[number] = begin + int(far.argmin())
    taking, which = np.unique(target, return_inverse=True)
    total = weights[held.row[taking]]
    np.add.at(total, which.ravel(), moved)
    row = held.row.copy()
    row[taking] = len(weights) + np.arange(len(taking))
    return row, np.concatenate([weights, total])
