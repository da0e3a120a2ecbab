"""The visible part of a scene: surfaces, motion and camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array


@dataclass(frozen=True)
class Appearance:
    """The surface of an object.

    Attributes
    ----------
    name
        Name of the object in the scene.
    vertices : (V, 3) [m]
        In the object's own axes, from its centre of mass.
    faces : (F, 3)
        Vertices of triangles.
    colour : (3,)
        Red, green and blue from 0 to 1 (sRGB).
    """

    name: str
    vertices: Array
    faces: NDArray[np.integer]
    colour: tuple[float, float, float]


@dataclass(frozen=True)
class Motion:
    """Positions and rotations of B objects at T times.

    Attributes
    ----------
    times : (T,) [s]
        Times at equal steps from 0.
    positions : (T, B, 3) [m]
        Positions of the centres of mass; z points up.
    rotations : (T, B, 4)
        Unit quaternions (w, x, y, z) that turn an object's own axes to those of the scene.
    """

    times: Array
    positions: Array
    rotations: Array

    def at(self, seconds: float) -> tuple[Array, Array]:
        """Positions (B, 3) [m] and rotations (B, 4) at a time, interpolated between steps."""
        place = float(np.clip(np.interp(seconds, self.times, np.arange(len(self.times))), 0, None))
        before = min(int(place), len(self.times) - 1)
        after = min(before + 1, len(self.times) - 1)
        share = place - before
        first, second = self.rotations[before], self.rotations[after]
        # A quaternion and its negative are one rotation: the nearer one is taken.
        second = np.where((first * second).sum(axis=1, keepdims=True) < 0.0, -second, second)
        turned = (1.0 - share) * first + share * second
        turned /= np.linalg.norm(turned, axis=1, keepdims=True)
        moved = (1.0 - share) * self.positions[before] + share * self.positions[after]
        return moved, turned


@dataclass(frozen=True)
class Camera:
    """The camera.

    Attributes
    ----------
    position, target : (3,) [m]
        Position of the camera, and point in the middle of the picture.
    degrees : float
        Vertical field of view.
    """

    position: tuple[float, float, float]
    target: tuple[float, float, float]
    degrees: float = 36.0


@dataclass(frozen=True)
class Picture:
    """The visible part of a scene.

    Attributes
    ----------
    objects : B surfaces
        Surfaces of the objects, in the order of the motion.
    motion
        Motion of the objects.
    ground : float [m] or None
        Height of the ground, if there is one.
    camera
        The camera.
    """

    objects: list[Appearance]
    motion: Motion
    ground: float | None
    camera: Camera


def linear_light(colour: Sequence[float]) -> Array:
    """Light of a colour (3,) in sRGB, both from 0 to 1 (IEC 61966-2-1).

    Examples
    --------
    >>> linear_light((0.0, 0.5, 1.0)).round(4).tolist()
    [0.0, 0.214, 1.0]
    """
    parts = np.array(colour, dtype=float)
    return np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
