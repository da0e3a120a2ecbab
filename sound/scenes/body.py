"""A rigid body with a surface that gives way and modes that sound."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from carillon.arrays import Array
from sound.rendering.listening import Listening
from sound.rendering.solid import SoundingSolid
from sound.scenes.scene import ObjectEntry
from sound.scenes.shape import Shape


@dataclass(frozen=True)
class Body:
    """An object of a scene.

    Its own axes have their origin at the centre of mass; z points up before it is turned.

    Attributes
    ----------
    entry
        The object's entry in the scene.
    mass, inertia : float [kg], (3, 3) [kg m^2]
        Mass, and inertia about the centre of mass in the body's own axes.
    centre : (3,) [m]
        Centre of mass, in the coordinates of the solid.
    shape
        Surface.
    compliance : (V,) [1/Pa]
        Compliance of the material at the surface's vertices, see `sound.scenes.hertz.compliance`.
    parts : list of (n, 3) [m]
        Corners of the convex parts that collide, in the body's own axes; none for a ball.
    solid
        Modes; None if the body is silent.
    listening
        Loudness and noise of a design's clips; None for a body of no design.
    radius : float [m] or None
        Radius of a ball, None for any other body.
    turn : (3, 3) or None
        Rotation from the coordinates of the solid to the body's own axes; None if they agree.
    accuracy : dict or None
        Expected errors of the frequencies, see `sound.scenes.uniform.UniformSolid`; None if they
        are unknown.
    """

    entry: ObjectEntry
    mass: float
    inertia: Array
    centre: Array
    shape: Shape
    compliance: Array
    parts: list[Array]
    solid: SoundingSolid | None
    listening: Listening | None
    radius: float | None
    turn: Array | None
    accuracy: dict[str, Any] | None

    @property
    def volume(self) -> float:
        """Volume of the material [m^3]."""
        silent = self.entry.made_of.density
        return self.mass / (silent if self.solid is None else self.solid.model.density)

    def motion(self, places: Array) -> Array:
        """Displacement (p, 3, k) [kg^-1/2] in each mode at places (p, 3) [m], in own axes."""
        assert self.solid is not None
        moved = self.solid.motion(self.in_solid(places))
        return moved if self.turn is None else np.einsum("ij,pjk->pik", self.turn, moved)

    def in_solid(self, places: Array) -> Array:
        """Coordinates (p, 3) [m] in the solid of places (p, 3) [m] in the body's own axes."""
        return self.along_solid(places) + self.centre

    def along_solid(self, vectors: Array) -> Array:
        """Components (p, 3) in the solid's axes of vectors (p, 3) in the body's own axes."""
        return vectors if self.turn is None else vectors @ self.turn

    def gains(self, places: Array) -> Array:
        """Loudness (p, 1) of strikes at places (p, 3) [m] by a design's clips; 1 without a design.

        The unit is that of `sound.rendering.listening.Listening.gain`.
        """
        if self.listening is None:
            return np.ones((len(places), 1))
        return np.array([[self.listening.gain(place)] for place in self.in_solid(places)])
