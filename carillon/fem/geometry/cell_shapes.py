"""Elements of volume meshes by their faces: which nodes these have, and triangles that they are.

Nodes are in VTK's order (vtkCellType.h; that of meshio differs for wedges in a turn alone, which
changes no face).
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from carillon.arrays import Array, Index

_TETRAHEDRON = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2))
_HEXAHEDRON = (
    (0, 4, 7, 3),
    (1, 2, 6, 5),
    (0, 1, 5, 4),
    (3, 7, 6, 2),
    (0, 3, 2, 1),
    (4, 5, 6, 7),
)
_WEDGE = ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5))
_PYRAMID = ((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4))
_TETRAHEDRON_EDGES = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))
_HEXAHEDRON_EDGES = (
    *((0, 1), (1, 2), (2, 3), (0, 3), (4, 5), (5, 6), (6, 7), (4, 7)),
    *((0, 4), (1, 5), (2, 6), (3, 7)),
)
_WEDGE_EDGES = ((0, 1), (1, 2), (0, 2), (3, 4), (4, 5), (3, 5), (0, 3), (1, 4), (2, 5))
_PYRAMID_EDGES = ((0, 1), (1, 2), (2, 3), (0, 3), (0, 4), (1, 4), (2, 4), (3, 4))

Edges = tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class CellShape:
    """A kind of element."""

    vtk: int
    """VTK's number of it."""
    nodes: int
    corners: int
    faces: tuple[tuple[int, ...], ...]
    """Corners of each face, around it; all faces are turned alike."""
    edges: Edges = ()
    """Corners of the edges whose middles are the nodes after the corners; none in linear ones."""
    middles: dict[int, int] = field(default_factory=dict)
    """Nodes in the middle of faces, by the number of the face."""

    def middle_of(self, one: int, other: int) -> int:
        """The node in the middle of an edge."""
        return self.corners + self.edges.index((min(one, other), max(one, other)))


SHAPES = {
    "tetra": CellShape(10, 4, 4, _TETRAHEDRON),
    "hexahedron": CellShape(12, 8, 8, _HEXAHEDRON),
    "wedge": CellShape(13, 6, 6, _WEDGE),
    "pyramid": CellShape(14, 5, 5, _PYRAMID),
    "tetra10": CellShape(24, 10, 4, _TETRAHEDRON, _TETRAHEDRON_EDGES),
    "hexahedron20": CellShape(25, 20, 8, _HEXAHEDRON, _HEXAHEDRON_EDGES),
    "wedge15": CellShape(26, 15, 6, _WEDGE, _WEDGE_EDGES),
    "pyramid13": CellShape(27, 13, 5, _PYRAMID, _PYRAMID_EDGES),
    "hexahedron27": CellShape(
        29, 27, 8, _HEXAHEDRON, _HEXAHEDRON_EDGES, {face: 20 + face for face in range(6)}
    ),
    "wedge18": CellShape(32, 18, 6, _WEDGE, _WEDGE_EDGES, {2: 15, 3: 16, 4: 17}),
}
"""Kinds of elements by meshio's names."""


@dataclass(frozen=True)
class CellFaces:
    """The same face of all elements of one kind."""

    corners: Index
    """(c, 3) or (c, 4) points, around the face."""
    triangles: Index
    """(c, t, 3) points; of quadratic faces, which may be curved, between all their nodes."""
    added: Array
    """(a, 3) points in the middle of curved faces, which come after those of the mesh."""


def faces_of(name: str, cells: Index, points: Array, added: int) -> Iterator[CellFaces]:
    """The faces of elements (c, nodes), one after the other.

    Neighbours cut a face alike: plane squares along the diagonal from the corner with the lowest
    number. `added`: number of points (p, 3) and of those that have been added before.
    """
    shape = SHAPES[name]
    for number, face in enumerate(shape.faces):
        corners = cells[:, face]
        if not shape.edges:
            yield CellFaces(corners, _plain(corners), np.empty((0, 3)))
            continue
        around = list(zip(face, (*face[1:], face[0]), strict=True))
        middles = cells[:, [shape.middle_of(*ends) for ends in around]]
        count = len(face)
        if count == 3:
            inner = [corners, middles]
            yield CellFaces(corners, _cut_triangle(*inner), np.empty((0, 3)))
            continue
        new = np.empty((0, 3))
        if number in shape.middles:
            centre = cells[:, shape.middles[number]]
        else:  # where the eight nodes' shape functions have it
            new = 0.5 * points[middles].sum(axis=1) - 0.25 * points[corners].sum(axis=1)
            centre = added + np.arange(len(cells))
            added += len(cells)
        ring = np.stack([corners, middles], axis=2).reshape(len(cells), 2 * count)
        following = np.roll(ring, -1, axis=1)
        middle = np.broadcast_to(centre[:, None], ring.shape)
        yield CellFaces(corners, np.stack([ring, following, middle], axis=2), new)


def _plain(corners: Index) -> Index:
    if corners.shape[1] == 3:
        return corners[:, None]
    a, b, c, d = corners.T
    through_a = (corners.argmin(axis=1) % 2 == 0)[:, None, None]
    one = np.stack([np.stack([a, b, c], 1), np.stack([a, c, d], 1)], axis=1)
    other = np.stack([np.stack([b, c, d], 1), np.stack([b, d, a], 1)], axis=1)
    return np.where(through_a, one, other)


def _cut_triangle(corners: Index, middles: Index) -> Index:
    """Four triangles of one with nodes in the middles of its edges."""
    before = np.roll(middles, 1, axis=1)
    outer = np.stack([corners, middles, before], axis=2)
    return np.concatenate([outer, middles[:, None]], axis=1)
