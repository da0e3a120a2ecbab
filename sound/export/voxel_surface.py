"""Closed surfaces around sets of voxels, manifold wherever voxels meet at an edge or corner only.

Each plane between voxels becomes two planes a little apart, with thin cells between them that are
filled where all voxels about them are. Voxels that share no face are apart then, and of the eight
cells about any vertex the filled ones are, with each cell, all those that lie between it and its
voxel: of these sets none has a surface that is not a manifold. Where the surface was one before,
the thin cells are closed again, so that faces lie on those of voxels.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import scipy.ndimage as ndi
from numpy.typing import NDArray

from carillon.arrays import Array, Flags, Index

GAP = 0.01
"""Half of the distance between voxels that meet at an edge or corner only, in their edges."""


def voxel_surface(filled: Flags) -> tuple[Array, Index]:
    """Vertices (v, 3) and triangles (f, 3), facing outwards, around the voxels of a grid.

    Voxel (i, j, k) of `filled` (l, m, n) is the cube from there to (i + 1, j + 1, k + 1). Every
    edge of the surface is one of two triangles, and vertices at one place are one.

    Examples
    --------
    >>> vertices, faces = voxel_surface(np.ones((1, 1, 1), dtype=bool))
    >>> vertices.shape, faces.shape, float(vertices.max())
    ((8, 3), (12, 3), 1.0)
    """
    padded = np.pad(filled, 1)
    fine = padded
    for axis in range(3):
        fine = _with_thin_cells(fine, axis)
    plain = _plain_vertices(padded)
    # Two planes at each vertex; the first and the last plane of the padded grid have none.
    shape = tuple(2 * each for each in plain.shape)
    quads = np.concatenate([_quads(fine, axis, shape) for axis in range(3)])
    places = np.stack(np.unravel_index(quads, shape), axis=-1)
    at = places // 2
    merged = plain[tuple(np.moveaxis(at, -1, 0))]
    quads = np.where(merged, np.ravel_multi_index(tuple(np.moveaxis(2 * at, -1, 0)), shape), quads)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    a, b, c = triangles.T
    triangles = triangles[(a != b) & (b != c) & (a != c)]
    used, faces = np.unique(triangles, return_inverse=True)
    corner = np.stack(np.unravel_index(used, shape), axis=-1)
    apart = np.where(plain[tuple((corner // 2).T)], 0.0, GAP)[:, None]
    vertices = corner // 2 + apart * (2 * (corner % 2) - 1)
    return vertices, faces.reshape(-1, 3)


def _with_thin_cells(filled: Flags, axis: int) -> Flags:
    """The cells with thin ones between them along an axis, filled where both neighbours are."""
    cells = np.moveaxis(filled, axis, 0)
    made = np.zeros((2 * len(cells) - 1, *cells.shape[1:]), dtype=bool)
    made[::2] = cells
    made[1::2] = cells[:-1] & cells[1:]
    return np.moveaxis(made, 0, axis)


def _quads(fine: Flags, axis: int, shape: tuple[int, ...]) -> Index:
    """Numbers (q, 4) of the vertices of the faces across an axis, anticlockwise from outside."""
    cells = np.moveaxis(fine, axis, 0)
    found = []
    for side in (1, -1):
        before, after = (cells[:-1], cells[1:]) if side > 0 else (cells[1:], cells[:-1])
        places = np.argwhere(before & ~after)
        # The plane after cell j is vertex j of those within the padded grid; likewise across.
        corners = np.array([[0, 0, 0], [0, 1, 0], [0, 1, 1], [0, 0, 1]])[::side]
        own = places[:, None] + corners - np.array([0, 1, 1])
        others = [each for each in range(3) if each != axis]
        order = np.empty(3, dtype=np.int64)
        order[[axis, *others]] = np.arange(3)
        turned = own[:, :, order]
        if axis == 1:
            turned = turned[:, ::-1]
        found.append(np.ravel_multi_index(tuple(np.moveaxis(turned, -1, 0)), shape))
    return np.concatenate(found)


def _plain_vertices(padded: Flags) -> Flags:
    """Whether the surface is a manifold at each vertex within a padded grid."""
    bits = np.zeros(tuple(each - 1 for each in padded.shape), dtype=np.uint8)
    ends = [(slice(None, -1), slice(1, None))] * 3
    for bit in range(8):
        part = tuple(ends[axis][bit >> axis & 1] for axis in range(3))
        bits += np.uint8(1 << bit) * padded[part]
    return np.asarray(_manifold_patterns()[bits])


@cache
def _manifold_patterns() -> NDArray[np.bool_]:
    """For each pattern of eight voxels about a vertex, whether both the filled and the empty ones
    hang together by faces."""
    found = np.empty(256, dtype=bool)
    for pattern in range(256):
        cube = np.array([pattern >> bit & 1 for bit in range(8)], dtype=bool).reshape(2, 2, 2)
        found[pattern] = max(ndi.label(cube)[1], ndi.label(~cube)[1]) <= 1
    return found
