"""Parts of a surface: what hangs together, and what of it is closed by itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array, Flags, Index
from carillon.fem.geometry.facets import Facets, connected

EXACT = 20_000_000
"""Products of points and triangles up to which winding numbers are summed exactly."""


@dataclass(frozen=True)
class ClosedPart:
    """What of a surface is closed by itself."""

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
    found = []
    for own in np.split(order, np.flatnonzero(np.diff(part[order])) + 1):
        if closed[part[own[0]]]:
            corners = facets.vertices[facets.triangles[own]].reshape(-1, 3)
            volume = outward * float(volumes[part[own[0]]])
            found.append(ClosedPart(own, volume, corners.min(axis=0), corners.max(axis=0)))
    return found


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
