"""Quadratic tetrahedra of solids whose parts overlap, united by the geometry kernel of Gmsh."""

import time
from collections.abc import Callable, Iterator, Sequence
from itertools import compress, pairwise
from typing import Any

import numpy as np
import scipy.linalg as la

from carillon.arrays import Array, Index, Surface
from carillon.fem.model import RIGID_MODES
from studies.accuracy.spectra import Spectrum
from studies.accuracy.tetrahedra import GMSH_TETRAHEDRON, gmsh_elements, lowest, matrices
from studies.thin_walls.grading import grade
from studies.thin_walls.profiles import Profile

ORDER = 2
"""Degree of the shape functions and of the faces."""
Part = Profile | Surface
"""Part of a solid: a polygon that turns, or a closed surface whose facets are meant."""


ON_SURFACE = 1e-6
"""Distance [m] within which a point lies on a surface."""
AROUND, RADIUS = 32, 2e-5
"""Number of points about a curve that tell whether it is a notch, and their distance [m]."""
ACROSS = 2.0
"""Edges of tetrahedra across the thinnest side of a part of facets."""
NOTCH = 0.1
"""Least share of the space about a notch that is inside, above a half."""


def quadratic_tetrahedra(
    parts: Sequence[Part], size: float, elastic: int, finer: float = 1.0
) -> Spectrum:
    """Lowest eigenvalues of the united parts, see `mesh`, with so many `elastic` ones."""
    return spectrum_on(lambda: mesh(parts, size, finer), size, elastic)


def spectrum_on(made: Callable[[], tuple[Array, Index]], size: float, elastic: int) -> Spectrum:
    """Lowest eigenvalues on a mesh that is `made`, points and elements with edges of `size` [m]."""
    begin = time.perf_counter()
    points, elements = made()
    meshed = time.perf_counter()
    K, M = matrices(points, elements)
    longest = float(np.ptp(points, axis=0).max())
    values = lowest(K, M, RIGID_MODES + elastic, longest)
    solved = time.perf_counter()
    return Spectrum(values, size / ORDER, K.shape[0], meshed - begin, solved - meshed)


def mesh(parts: Sequence[Part], size: float, finer: float = 1.0) -> tuple[Array, Index]:
    """Points (n, 3) [m] and elements (m, 10) of the united parts; turned faces are curved.

    Edges of tetrahedra are about `size` [m], and shorter by the factor `finer` where parts meet
    in edges that point inwards; where `finer` is more than 1, parts of facets have `ACROSS` edges
    across.
    """

    def draw(gmsh: Any) -> None:
        shapes = gmsh.model.occ
        first, *others = (
            _turned(shapes, part) if isinstance(part, Profile) else _faceted(shapes, part)
            for part in parts
        )
        if others:
            shapes.fuse([first], others)
        if finer > 1.0:
            grade(gmsh, "CurvesList", _notches(gmsh, parts), size, finer, list(_boxes(parts, size)))

    return gmsh_elements(draw, size, ORDER, GMSH_TETRAHEDRON[ORDER])


def _notches(gmsh: Any, parts: Sequence[Part]) -> list[int]:
    """Curves in which surfaces of two parts meet, and more than half of the space is inside."""
    gmsh.model.occ.synchronize()
    volumes = [volume for _, volume in gmsh.model.getEntities(3)]
    curves = [curve for _, curve in gmsh.model.getEntities(1)]
    middles = {}
    for curve in curves:
        (low,), (high,) = gmsh.model.getParametrizationBounds(1, curve)
        middles[curve] = [0.5 * (low + high)]
    places = np.array([gmsh.model.getValue(1, curve, middles[curve]) for curve in curves])
    on_surface = np.sum([_distances(part, places) < ON_SURFACE for part in parts], axis=0)
    angle = 2.0 * np.pi * (np.arange(AROUND) + 0.5) / AROUND
    found = []
    for curve, place in compress(zip(curves, places), on_surface > 1):
        tangent = np.array(gmsh.model.getDerivative(1, curve, middles[curve]))
        _, _, axes = la.svd(tangent[None])
        circle = RADIUS * np.column_stack([np.cos(angle), np.sin(angle)]) @ axes[1:]
        points = (place + circle).ravel()
        inside = sum(gmsh.model.isInside(3, volume, points) for volume in volumes)
        if inside > (0.5 + NOTCH) * AROUND:
            found.append(curve)
    return found


def _boxes(parts: Sequence[Part], size: float) -> Iterator[tuple[Array, float]]:
    """Boxes around parts that need smaller edges, and these [m]."""
    for part in parts:
        if not isinstance(part, Profile):
            edge = float(part.extents.min()) / ACROSS
            if edge < size:
                yield part.bounds, edge


def _distances(part: Part, points: Array) -> Array:
    """Distances (n,) [m] of points (n, 3) from the surface of a part."""
    if isinstance(part, Profile):
        return part.distances(points)
    from trimesh.proximity import closest_point_naive

    return np.asarray(closest_point_naive(part, points)[1])


def _turned(shapes: Any, profile: Profile) -> tuple[int, int]:
    """The volume of a polygon that is turned about z."""
    points = [shapes.addPoint(radius, 0.0, height) for radius, height in profile.points]
    sides = [shapes.addLine(a, b) for a, b in pairwise([*points, points[0]])]
    face = shapes.addPlaneSurface([shapes.addCurveLoop(sides)])
    turned = shapes.revolve([(2, face)], 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 2.0 * np.pi)
    volume = next(entity for entity in turned if entity[0] == 3)
    shapes.remove([(2, face)], recursive=True)
    return volume


def _faceted(shapes: Any, surface: Surface) -> tuple[int, int]:
    """The volume inside of triangles; those that lie in one plane are one face."""
    points = [shapes.addPoint(*vertex) for vertex in surface.vertices]
    lines = [shapes.addLine(points[a], points[b]) for a, b in surface.edges_unique]
    faces = []
    for ends, edges in zip(surface.faces, surface.faces_unique_edges):
        loop = []
        for a, b in pairwise([*ends, ends[0]]):
            edge = next(e for e in edges if set(surface.edges_unique[e]) == {a, b})
            loop.append(lines[edge] if surface.edges_unique[edge][0] == a else -lines[edge])
        faces.append(shapes.addPlaneSurface([shapes.addCurveLoop(loop)]))
    volume = shapes.addVolume([shapes.addSurfaceLoop(faces)])
    return (3, volume)
