"""Preparation of surfaces for convex decomposition: open ones are closed, fine ones coarsened."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Integers, Surface
from carillon.errors import UserError

HOLLOW = 0.02
"""Greatest share of its hull that a convex solid leaves empty."""
GRIDS = ((40, 0.0), (40, 0.38), (80, 0.38), (160, 0.38))
"""Grids that close an open surface: number of cells along the longest side, and offset of the
surface in cells.  The first grid that gives a closed surface is taken.

Without an offset, flat walls may lie on grid points, which are neither inside nor outside then.
"""
MOST_FACES = (800, 1600)
"""Numbers of faces that a surface is coarsened to, the first that works."""
JITTER = 1e-4
"""Random displacement of vertices before coarsening, over the longest side; in an exact plane,
triangles would fold over each other.
"""
EDGES_AT_ONCE = 256
"""Number of edges that are tested against all triangles at once."""


class Cuttable(NamedTuple):
    """A closed surface of a solid, and CoACD's preprocessing of it: "off", or "auto" for one that
    may cross itself.

    CoACD then remeshes crossings and narrow gaps, into a thicker surface that takes far longer to
    cut.
    """

    surface: Surface
    preprocessing: str


def components(surface: Surface) -> list[Surface]:
    """Closed surfaces of a solid: its pieces, or the whole if it has cavities.

    Pieces that touch but share no vertices, as boards of a box, are separate.  The list is empty if
    a surface is open or inside out.
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


def _is_solid(surface: Surface) -> bool:
    closed = surface.is_watertight and surface.is_winding_consistent
    return bool(closed and _volume(surface) > 0.0)


def _volume(surface: Surface) -> float:
    """Volume [m^3], negative if the surface is inside out; without warnings if it is flat."""
    return float(np.linalg.det(surface.triangles).sum()) / 6.0


def is_convex(solid: Surface) -> bool:
    """Whether a closed surface leaves at most the share `HOLLOW` of its hull empty."""
    return bool(_volume(solid) >= (1.0 - HOLLOW) * solid.convex_hull.volume)


def remeshed(surface: Surface) -> list[Surface]:
    """Closed surfaces around the inside of one that is open, inside out or crosses itself.

    Raises UserError if the inside is empty.
    """
    for grid in GRIDS if surface.area > 0.0 else ():
        solids = components(_boundary(surface, *grid))
        if solids:
            return solids
    raise UserError(
        f"the surface encloses nothing that {GRIDS[-1][0]} cells along its longest side would "
        "show; close it, make its walls thicker, or take collision: hull"
    )


def _boundary(surface: Surface, cells: int, within: float) -> Surface:
    """The closed surface between the inner and the outer points of a grid."""
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


def _distances(surface: Surface, points: Array) -> Array:
    """Distances (p,) of points (p, 3) from a surface, negative within it."""
    import igl

    turned = surface.faces[:, ::-1] if _volume(surface) < 0.0 else surface.faces
    vertices = np.ascontiguousarray(surface.vertices, dtype=np.float64)
    faces = np.ascontiguousarray(turned, dtype=np.int64)
    sign = igl.SIGNED_DISTANCE_TYPE_FAST_WINDING_NUMBER
    return np.asarray(igl.signed_distance(points, vertices, faces, sign)[0])


def coarser(solid: Surface) -> Cuttable:
    """A coarser solid that does not cross itself, or else the solid as it is."""
    for faces in MOST_FACES:
        if len(solid.faces) <= faces:
            break
        fewer = _decimated(solid, faces)
        if _is_solid(fewer) and not crosses_itself(fewer):
            return Cuttable(fewer, "off")
    return Cuttable(solid, "auto")


def _decimated(solid: Surface, faces: int) -> Surface:
    """A coarser surface by edge collapses (Garland and Heckbert 1997)."""
    import igl
    import trimesh

    noise = np.random.default_rng(0).standard_normal(solid.vertices.shape)
    vertices = np.asfortranarray(solid.vertices + JITTER * np.max(solid.extents) * noise)
    given = np.asfortranarray(solid.faces, dtype=np.int32)
    return trimesh.Trimesh(*igl.qslim(vertices, given, faces, block_intersections=True)[:2])


def crosses_itself(surface: Surface) -> bool:
    """Whether an edge intersects a triangle that it does not touch."""
    parts = max(1, len(surface.edges_unique) // EDGES_AT_ONCE)
    return any(
        _cross(surface, edges).any() for edges in np.array_split(surface.edges_unique, parts)
    )


def _cross(surface: Surface, edges: Integers) -> NDArray[np.bool_]:
    """Which of the edges (e, 2) and triangles on whose two sides their ends lie intersect."""
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
