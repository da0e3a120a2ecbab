"""Closed surfaces by turning a profile about z and by sweeping a section along a curve."""

from collections.abc import Sequence
from typing import cast

import numpy as np
import trimesh
from trimesh.creation import revolve

SECTIONS = 96
"""Segments of a full turn."""

SPLINE_POINTS = 41
"""Points of a curve that a part is swept along."""


def joined(*parts: trimesh.Trimesh) -> trimesh.Trimesh:
    """The parts as one surface; they may overlap."""
    return cast(trimesh.Trimesh, trimesh.util.concatenate(parts))


def turned(radius: Sequence[float], height: Sequence[float], ring: bool = False) -> trimesh.Trimesh:
    """Turn a profile about z; a `ring` closes on itself instead of on the axis."""
    points = np.column_stack([radius, height])
    return outward(revolve(np.vstack([points, points[:1]]) if ring else points, sections=SECTIONS))


def tube(
    centre: np.ndarray, radius: float | np.ndarray, flatten: float | None = None
) -> trimesh.Trimesh:
    """Tube around a curve (k, 3) in the plane y = 0; `flatten` is its half height if elliptic."""
    across = np.broadcast_to(np.asarray(radius, dtype=float), len(centre))
    height = across if flatten is None else np.minimum(flatten, across)
    tangent = np.gradient(centre, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    side = np.array([0.0, 1.0, 0.0])
    normal = np.cross(tangent, side)
    turn = np.linspace(0, 2 * np.pi, 24, endpoint=False)[None, :, None]
    return sweep(
        centre[:, None, :]
        + across[:, None, None] * np.cos(turn) * side
        + height[:, None, None] * np.sin(turn) * normal[:, None, :]
    )


def sweep(sections: np.ndarray) -> trimesh.Trimesh:
    """Closed surface through cross-sections (k, p, 3), with a fan over the first and the last."""
    k, p = sections.shape[:2]
    ends = sections[[0, -1]].mean(axis=1)
    index = np.arange(k * p).reshape(k, p)
    after = np.roll(index, -1, axis=1)
    a, b, c, d = (part.ravel() for part in (index[:-1], after[:-1], after[1:], index[1:]))
    first = np.stack([np.full(p, k * p), after[0], index[0]], axis=1)
    last = np.stack([np.full(p, k * p + 1), index[-1], after[-1]], axis=1)
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1), first, last])
    return outward(trimesh.Trimesh(np.concatenate([sections.reshape(-1, 3), ends]), faces))


def spline(points: list[tuple[float, float]]) -> np.ndarray:
    """Bezier curve of (x, z) control points in the plane y = 0, (SPLINE_POINTS, 3)."""
    curve = np.array(points, dtype=float)[None]
    t = np.linspace(0, 1, SPLINE_POINTS)[:, None, None]
    while curve.shape[1] > 1:
        curve = (1 - t) * curve[:, :-1] + t * curve[:, 1:]
    return np.stack([curve[:, 0, 0], np.zeros(SPLINE_POINTS), curve[:, 0, 1]], axis=1)


def outward(surface: trimesh.Trimesh) -> trimesh.Trimesh:
    """The surface with its vertices merged and its faces turned outwards."""
    surface.merge_vertices()
    if surface.volume < 0:
        surface.invert()
    return surface
