"""Closed surfaces that can be cut into convex parts: open ones closed, fine ones made coarser."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from carillon.errors import UserError

if TYPE_CHECKING:  # Its import takes long, and a scene may have no solid of a mesh.
    import trimesh

Array = NDArray[np.float64]
Faces = NDArray[np.integer]

HOLLOW = 0.02
"""Share of its hull that a solid may leave empty and still be taken for convex."""
GRIDS = ((40, 0.0), (40, 0.38), (80, 0.38), (160, 0.38))
"""Grids in which what is not closed is made into a solid: cells along the longest side, and by how
many the surface lies within the grid.  The first one that shows a closed surface is taken.

Where a grid begins with the surface, flat walls may lie on points, which are neither inside nor
outside then.
"""
MOST_FACES = (800, 1600)
"""Of a surface that is cut; finer ones are made coarser before, as coarse as goes well."""
JITTER = 1e-4
"""By which vertices are displaced at random for that, over the longest side.

In a plane triangles fold over each other, as nothing speaks against it, unless vertices are off it.
"""
EDGES_AT_ONCE = 256
"""Of which it is tried whether they go through triangles."""


class Cuttable(NamedTuple):
    """A closed surface, and whether CoACD shall see to it that it crosses itself nowhere.

    Attributes
    ----------
    surface
        Of a solid.
    preprocessing
        "off", or "auto": CoACD then takes for crossing, too, what merely is narrow, and makes a
        surface of its own of that, which is thicker and takes far longer to cut.
    """

    surface: trimesh.Trimesh
    preprocessing: str


def components(surface: trimesh.Trimesh) -> list[trimesh.Trimesh]:
    """Closed surfaces of a solid: its pieces, or all at once if it has cavities.

    Pieces that share places but no vertices, as boards of a box at its corners, are apart.  None if
    something is open, or inside out.
    """
    import trimesh

    merged = trimesh.Trimesh(surface.vertices, surface.faces)
    for whole in (merged, surface):
        pieces = list(whole.split(only_watertight=False))
        for piece in pieces:
            piece.merge_vertices()
        if pieces and all(map(_is_solid, pieces)):
            return pieces
    return [merged] if _is_solid(merged) else []


def _is_solid(surface: trimesh.Trimesh) -> bool:
    closed = surface.is_watertight and surface.is_winding_consistent
    return bool(closed and _volume(surface) > 0.0)


def _volume(surface: trimesh.Trimesh) -> float:
    """Volume [m^3], negative if the surface is inside out; without warnings if it is flat."""
    return float(np.linalg.det(surface.triangles).sum()) / 6.0


def is_convex(solid: trimesh.Trimesh) -> bool:
    """Whether a closed surface hardly differs from its hull, see `HOLLOW`."""
    return bool(_volume(solid) >= (1.0 - HOLLOW) * solid.convex_hull.volume)


def remeshed(surface: trimesh.Trimesh) -> list[trimesh.Trimesh]:
    """Closed surfaces about the inside of one that is open, inside out or runs through itself.

    Raises
    ------
    UserError
        If nothing is inside.
    """
    for grid in GRIDS if surface.area > 0.0 else ():
        solids = components(_boundary(surface, *grid))
        if solids:
            return solids
    raise UserError(
        f"the surface encloses nothing that {GRIDS[-1][0]} cells along its longest side would "
        "show; close it, make its walls thicker, or take collision: hull"
    )


def _boundary(surface: trimesh.Trimesh, cells: int, within: float) -> trimesh.Trimesh:
    """The closed surface between points of a grid that are inside and those that are outside."""
    import igl
    import trimesh

    low, high = surface.bounds
    edge = float(np.max(high - low)) / cells
    counts = np.ceil((high - low) / edge).astype(int) + 3
    z, y, x = np.meshgrid(*(np.arange(n) for n in counts[::-1]), indexing="ij")
    places = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1) - 1.0 - within
    points = low + edge * places
    distances = _distances(surface, points)
    return trimesh.Trimesh(*igl.marching_cubes(distances, points, *map(int, counts), 0.0)[:2])


def _distances(surface: trimesh.Trimesh, points: Array) -> Array:
    """Distances (p,) of points (p, 3) from a surface, negative within it."""
    import igl

    turned = surface.faces[:, ::-1] if _volume(surface) < 0.0 else surface.faces
    vertices = np.ascontiguousarray(surface.vertices, dtype=np.float64)
    faces = np.ascontiguousarray(turned, dtype=np.int64)
    sign = igl.SIGNED_DISTANCE_TYPE_FAST_WINDING_NUMBER
    return np.asarray(igl.signed_distance(points, vertices, faces, sign)[0])


def coarser(solid: trimesh.Trimesh) -> Cuttable:
    """A solid of few faces that crosses itself nowhere, or else the solid as it is."""
    for faces in MOST_FACES:
        if len(solid.faces) <= faces:
            break
        fewer = _decimated(solid, faces)
        if _is_solid(fewer) and not crosses_itself(fewer):
            return Cuttable(fewer, "off")
    return Cuttable(solid, "auto")


def _decimated(solid: trimesh.Trimesh, faces: int) -> trimesh.Trimesh:
    """By collapsing edges that matter least (Garland and Heckbert 1997)."""
    import igl
    import trimesh

    noise = np.random.default_rng(0).standard_normal(solid.vertices.shape)
    vertices = np.asfortranarray(solid.vertices + JITTER * np.max(solid.extents) * noise)
    given = np.asfortranarray(solid.faces, dtype=np.int32)
    return trimesh.Trimesh(*igl.qslim(vertices, given, faces, block_intersections=True)[:2])


def crosses_itself(surface: trimesh.Trimesh) -> bool:
    """Whether an edge goes through a triangle that it does not end at."""
    parts = max(1, len(surface.edges_unique) // EDGES_AT_ONCE)
    return any(
        _cross(surface, edges).any() for edges in np.array_split(surface.edges_unique, parts)
    )


def _cross(surface: trimesh.Trimesh, edges: Faces) -> NDArray[np.bool_]:
    """Of edges (e, 2) and triangles on whose two sides their ends are, whether they meet."""
    first, along, across = np.moveaxis(surface.triangles, 1, 0)
    along, across = along - first, across - first
    normals = np.cross(along, across)
    begin, end = (surface.vertices[edges[:, side]] for side in range(2))
    above, below = (at @ normals.T - (first * normals).sum(axis=1) for at in (begin, end))
    touch = (edges[:, None, :, None] == surface.faces[:, None, :]).any(axis=(2, 3))
    edge, face = np.nonzero((above * below < 0.0) & ~touch)
    share = above[edge, face] / (above[edge, face] - below[edge, face])
    meeting = begin[edge] + share[:, None] * (end - begin)[edge] - first[face]
    unit = normals[face] / (normals[face] ** 2).sum(axis=1, keepdims=True)
    u = (np.cross(meeting, across[face]) * unit).sum(axis=1)
    v = (np.cross(along[face], meeting) * unit).sum(axis=1)
    return np.asarray((u > 0.0) & (v > 0.0) & (u + v < 1.0))
