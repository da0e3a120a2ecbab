"""Which triangles of a surface are one, share edges, and hang together in closed parts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from carillon.arrays import Array, Flags, Index

DIGITS = 7
"""Decimals, over the longest side, to which the places of two vertices agree that are one."""
EXACT = 20_000_000
"""Products of points and triangles up to which winding numbers are summed exactly."""


@dataclass(frozen=True)
class Facets:
    """Distinct triangles of a surface whose vertices are numbered by their places."""

    vertices: Array
    """(v, 3) over the longest side of the surface, from its lowest corner."""
    triangles: Index
    """(t, 3) distinct ones, turned as the first face that each stands for."""
    of_face: Index
    """(f,) triangle of each face; -1 of faces without an area."""
    along: Index
    """(f,) 1 for faces that are turned as their triangle, -1 for others."""
    sheet: Index
    """(t,) sheet of each triangle. Triangles of two sheets are not one, and share no edges."""

    @classmethod
    def of_surface(cls, vertices: Array, faces: Index, sheets: bool = False) -> Facets:
        """Distinct triangles of a surface with vertices (v, 3) and faces (f, 3).

        `sheets`: tell closed sheets apart, see `closed_sheets`; otherwise all is one sheet.
        """
        from trimesh.grouping import unique_rows

        low, high = vertices[faces].min(axis=(0, 1)), vertices[faces].max(axis=(0, 1))
        scaled = (vertices - low) / (high - low).max()
        first, number = unique_rows(scaled, digits=DIGITS)
        corners = number[faces]
        whole = np.flatnonzero((corners != np.roll(corners, 1, axis=1)).all(axis=1))
        ordered = np.sort(corners[whole], axis=1)
        sheet = np.zeros(len(whole), dtype=np.int64)
        if sheets:
            sheet = closed_sheets(corners[whole], faces[whole])
        chosen, of_whole = unique_rows(np.column_stack([ordered, sheet]))
        of_face = np.full(len(faces), -1)
        of_face[whole] = of_whole
        triangles = corners[whole[chosen]]
        # The corner after the lowest one tells which way a triangle is turned.
        follows = np.take_along_axis(
            corners, (corners.argmin(axis=1) + 1)[:, None] % 3, axis=1
        ).ravel()
        along = np.ones(len(faces), dtype=np.int64)
        along[whole] = np.where(follows[whole] == follows[whole[chosen]][of_whole], 1, -1)
        return cls(scaled[first], triangles, of_face, along, sheet[chosen])

    def __len__(self) -> int:
        return len(self.triangles)

    @cached_property
    def normals(self) -> Array:
        """Normals (t, 3) as long as twice the areas."""
        a, b, c = np.moveaxis(self.vertices[self.triangles], 1, 0)
        return np.asarray(np.cross(b - a, c - a))

    @cached_property
    def areas(self) -> Array:
        """Areas (t,)."""
        return np.asarray(0.5 * np.linalg.norm(self.normals, axis=1))

    @cached_property
    def edges(self) -> tuple[Index, Index, Index]:
        """Edge (3 t,) of each triangle's sides 01, 12, 20; ways (3 t,) along it; triangles at it.

        The ways are 1 and -1.
        """
        starts, ends = self.triangles.ravel(), np.roll(self.triangles, -1, axis=1).ravel()
        low, high = np.minimum(starts, ends), np.maximum(starts, ends)
        edge = np.unique(low * (int(high.max(initial=0)) + 1) + high, return_inverse=True)[1]
        if self.sheet.any():
            edge = edge * (int(self.sheet.max()) + 1) + np.repeat(self.sheet, 3)
        edge, counts = np.unique(edge, return_inverse=True, return_counts=True)[1:]
        return edge, np.where(starts < ends, 1, -1), counts

    @cached_property
    def links(self) -> tuple[Index, Index, Flags]:
        """Pairs of triangles (k,), (k,) that alone share an edge, and whether turned alike (k,)."""
        edge, way, counts = self.edges
        sides = np.flatnonzero(counts[edge] == 2)
        one, other = sides[np.argsort(edge[sides], kind="stable")].reshape(-1, 2).T
        return one // 3, other // 3, way[one] != way[other]

    @cached_property
    def patches(self) -> Index:
        """Patch (t,) of each triangle: of those that alone share edges."""
        return connected(len(self), *self.links[:2])

    def unbalanced(self, sign: Index) -> Index:
        """Sum (e,) of the ways in which triangles with these signs (t,), or without, pass edges."""
        edge, way, counts = self.edges
        return np.bincount(edge, way * np.repeat(sign, 3), minlength=len(counts)).astype(np.int64)


def closed_sheets(corners: Index, faces: Index) -> Index:
    """Sheet (f,) of each face of those that are closed by themselves; one if any is open.

    Where sheets share edges, places do not tell which faces go on in which: sheets are told apart
    by the vertices that their faces have in common, and by the order of the faces, since files hold
    part after part. `corners`, `faces` (f, 3): numbers of the places of the faces' corners, and of
    their vertices.

    Examples
    --------
    >>> tetrahedron = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    >>> other = np.array([0, 1, 4, 5])[tetrahedron]  # It shares the edge of 0 and 1.
    >>> closed_sheets(*[np.concatenate([tetrahedron, other])] * 2)
    array([0, 0, 0, 0, 1, 1, 1, 1])
    """
    count = len(faces)
    label = connected(
        count + int(faces.max(initial=0)) + 1, np.repeat(np.arange(count), 3), count + faces.ravel()
    )[:count]
    first = np.unique(label, return_index=True)[1]
    order = np.argsort(first[label], kind="stable")
    ends = np.sort(np.stack([corners, np.roll(corners, -1, axis=1)], axis=2)[order], axis=2)
    ends = ends.reshape(-1, 2)
    keys = ends[:, 0] * (int(ends.max(initial=0)) + 1) + ends[:, 1]
    side = np.argsort(keys, kind="stable")
    starts = np.flatnonzero(np.diff(keys[side], prepend=-1))
    before = np.arange(len(keys)) - np.repeat(starts, np.diff(np.append(starts, len(keys))))
    # An edge that comes again closes what it opened.
    opened = np.empty(len(keys), dtype=np.int64)
    opened[side] = 1 - 2 * (before % 2)
    closed = np.cumsum(opened.reshape(-1, 3).sum(axis=1)) == 0
    sheet = np.zeros(count, dtype=np.int64)
    if count and closed[-1]:
        sheet[order] = np.cumsum(closed) - closed
    return sheet


def connected(count: int, left: Index, right: Index) -> Index:
    """Component (count,) of each of things that are linked in pairs."""
    from scipy.sparse.csgraph import connected_components  # Its import takes long.

    graph = sp.coo_matrix((np.ones(len(left)), (left, right)), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


@dataclass(frozen=True)
class ClosedPart:
    """Triangles of a surface that enclose a volume by themselves."""

    triangles: Index
    """Its triangles (k,)."""
    volume: float
    """Positive if turned as the most of the surface's parts, negative of cavities; of a surface
    whose longest side is one."""
    low: Array
    high: Array
    """(3,) corners of the box around it."""


def closed_parts(facets: Facets) -> list[ClosedPart]:
    """The closed parts of a surface whose faces are turned alike."""
    ones = np.ones(len(facets), dtype=np.int64)
    part, closed = parts_of(facets, ones, facets.unbalanced(ones))
    volumes = signed_volumes(facets, part, ones)
    outward = 1.0 if volumes[closed].sum() >= 0.0 else -1.0
    order = np.argsort(part, kind="stable")
    parts = []
    for own in np.split(order, np.flatnonzero(np.diff(part[order])) + 1):
        if closed[part[own[0]]]:
            corners = facets.vertices[facets.triangles[own]].reshape(-1, 3)
            volume = outward * float(volumes[part[own[0]]])
            parts.append(ClosedPart(own, volume, corners.min(axis=0), corners.max(axis=0)))
    return parts


def parts_of(facets: Facets, sign: Index, balance: Index) -> tuple[Index, Flags]:
    """Part (t,) of each triangle, and whether each part (p,) is closed.

    A patch that is closed by itself is a part, whatever it touches; others are by the edges that
    they share.

    `sign` (t,) is 1 for triangles as they are, -1 for those to be turned, 0 for those that do not
    count; `balance` (e,) is that of `Facets.unbalanced`.
    """
    patch = facets.patches
    edge, way, counts = facets.edges
    side_patch = np.repeat(patch, 3)
    shared = counts[edge] > 2
    own, index = np.unique(np.stack([side_patch, edge])[:, shared], axis=1, return_inverse=True)
    sums = np.bincount(index.ravel(), (way * np.repeat(sign, 3))[shared], minlength=own.shape[1])
    apart = np.ones(patch.max() + 1, dtype=bool)
    apart[own[0][sums != 0]] = False
    apart[side_patch[counts[edge] == 1]] = False
    apart[patch[sign == 0]] = False
    joins = ~apart[own[0]]
    patches = len(apart)
    label = connected(patches + len(counts), own[0][joins], patches + own[1][joins])[:patches]
    part = np.unique(label, return_inverse=True)[1][patch]
    is_open = np.bincount(np.repeat(part, 3), balance[edge] != 0, minlength=part.max() + 1) > 0
    return part, ~is_open


def signed_volumes(facets: Facets, part: Index, sign: Index) -> Array:
    """Signed volumes (p,), by cones from a corner of each part."""
    first = np.zeros(part.max() + 1, dtype=np.int64)
    first[part[::-1]] = facets.triangles[::-1, 0]
    corners = facets.vertices[facets.triangles[:, 0]] - facets.vertices[first[part]]
    cones = np.einsum("ti,ti->t", corners, facets.normals) / 6.0
    return np.asarray(np.bincount(part, cones * sign))


def winding_numbers(facets: Facets, own: Index, points: Array, sign: Index | None = None) -> Array:
    """Winding numbers (k,) of the triangles `own` about points (k, 3)."""
    import igl

    if not len(points) or not len(own):
        return np.zeros(len(points))
    triangles = facets.triangles[own]
    if sign is not None:
        signs = sign[own]
        triangles = np.where(signs[:, None] > 0, triangles, triangles[:, ::-1])[signs != 0]
    exact = len(points) * len(triangles) <= EXACT
    compute = igl.winding_number if exact else igl.fast_winding_number
    arrays = (facets.vertices, triangles, points)
    return np.asarray(compute(*map(np.ascontiguousarray, arrays)))
