"""Round rods among solids: prisms of many sides stand for cylinders, which roll without clatter."""

from typing import NamedTuple

import numpy as np

from carillon.arrays import Array

FEWEST_SIDES = 12
"""Fewest sides of a prism that stands for a cylinder; others roll as prisms do."""
OFF = 2e-3
"""Distance of its corners from a cylinder, over the radius, that rounding leaves."""


class Cylinder(NamedTuple):
    """A cylinder with its centre at `centre` (3,) [m], of a unit vector `axis` (3,), a radius [m]
    and half a length [m].
    """

    centre: Array
    axis: Array
    radius: float
    half_length: float


def cylinder_of(corners: Array) -> Cylinder | None:
    """The cylinder around the corners (n, 3) [m] of a convex solid; None if it is no such prism.

    Examples
    --------
    >>> angles = np.arange(24) * np.pi / 12.0
    >>> ring = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(24)])
    >>> rod = cylinder_of(np.concatenate([ring - [0, 0, 3], ring + [0, 0, 3]]))
    >>> round(rod.radius, 6), round(rod.half_length, 6), rod.axis.round(6).tolist()
    (1.0, 3.0, [0.0, 0.0, 1.0])
    >>> cylinder_of(np.random.default_rng(0).standard_normal((40, 3))) is None
    True
    """
    from scipy.spatial import ConvexHull

    hull = ConvexHull(corners)
    points = corners[hull.vertices]
    # Both ends are faces of the hull, so the axis is a normal of these.
    for axis in _normals_of_pairs(hull.equations[:, :3]):
        along = points @ axis
        low, high = along.min(), along.max()
        size = high - low
        if np.minimum(along - low, high - along).max() > OFF * size:
            continue
        aside = points - along[:, None] * axis
        rings = [aside[along < low + 0.5 * size], aside[along > low + 0.5 * size]]
        middle = 0.5 * (rings[0].min(axis=0) + rings[0].max(axis=0))
        middle = _centre(rings[0], axis, middle)
        away = np.linalg.norm(aside - middle, axis=1)
        radius = float(away.max())
        round_ = away >= (1.0 - OFF) * radius
        if not round_.all() or not all(_is_ring(each - middle, axis) for each in rings):
            continue
        axis = axis * np.sign(axis[np.abs(axis).argmax()]) + 0.0  # no negative zeros
        along = points @ axis
        centre = middle + 0.5 * float(along.min() + along.max()) * axis
        return Cylinder(centre, axis, radius, 0.5 * float(size))
    return None


def _normals_of_pairs(normals: Array) -> Array:
    """Unit normals (k, 3) of faces that have an opposite one, those of most triangles first."""
    rounded = np.round(normals, 6)
    kinds, counts = np.unique(rounded, axis=0, return_counts=True)
    order = np.argsort(-counts, kind="stable")[:2]
    unit = kinds[order] / np.linalg.norm(kinds[order], axis=1, keepdims=True)
    return np.asarray(unit)


def _centre(ring: Array, axis: Array, about: Array) -> Array:
    """Middle (3,) of the circle through points (n, 3) about an axis, by least squares."""
    first = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    first /= np.linalg.norm(first)
    plane = np.stack([first, np.cross(axis, first)])
    flat = (ring - about) @ plane.T
    left = np.column_stack([2.0 * flat, np.ones(len(flat))])
    x, y, _ = np.linalg.lstsq(left, (flat**2).sum(axis=1), rcond=None)[0]
    return np.asarray(about + x * plane[0] + y * plane[1])


def _is_ring(points: Array, axis: Array) -> bool:
    """Whether points (n, 3) about an axis leave no wide gap between their directions."""
    if len(points) < FEWEST_SIDES:
        return False
    first = points[0] / np.linalg.norm(points[0])
    angles = np.sort(np.arctan2(points @ np.cross(axis, first), points @ first))
    gaps = np.diff(np.append(angles, angles[0] + 2.0 * np.pi))
    return bool(gaps.max() <= 1.01 * 2.0 * np.pi / FEWEST_SIDES)
