"""The bodies of a scene's objects: solids set upright, with what collides of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from carillon.arrays import Array, Integers
from carillon.composition.materials import NamedMaterial
from carillon.errors import ConvergenceError, UserError
from carillon.parameters.sentences import in_keys
from sound.rendering.listening import Listening
from sound.rendering.solid import SoundingSolid
from sound.scenes.convex import convex_parts, hull_of
from sound.scenes.cylinder import Cylinder, cylinder_of
from sound.scenes.divided import parts_of_one
from sound.scenes.hertz import compliance
from sound.scenes.object_entry import ObjectEntry
from sound.scenes.object_solid import ObjectSolid, Sounding, object_solid
from sound.shape import Shape

LIGHTEST = 1e-9
"""Least mass [kg] of a body that the engine of rigid bodies can move."""


@dataclass(frozen=True)
class Body:
    """An object of a scene.

    Its own axes have their origin at the centre of mass; z points up before it is turned.

    Attributes
    ----------
    entry, shape
        The object's entry in the scene, and its surface.
    """

    entry: ObjectEntry
    mass: float
    inertia: Array
    """float [kg], (3, 3) [kg m^2]: mass, and inertia about the centre of mass in the body's own
    axes."""
    centre: Array
    """(3,) [m]: centre of mass, in the coordinates of the solid."""
    shape: Shape
    compliance: Array
    """(V,) [1/Pa]: compliance of the material at the surface's vertices, see
    `sound.scenes.hertz.compliance`."""
    materials: tuple[NamedMaterial, ...]
    which: Integers
    """What the surface is of, and number (V,) of that at each vertex."""
    parts: list[Array]
    """list of (n, 3) [m]: corners of the convex parts that collide, in the body's own axes; none
    for a ball."""
    of_parts: tuple[int, ...]
    """Number of the material of each part."""
    cylinder: Cylinder | None
    """The cylinder in place of its only part, None if it is none."""
    volume: float
    """float [m^3]: volume of the material."""
    find: Callable[[], Sounding] | None
    """Finds how the body sounds, see `with_modes`; None if it is silent."""
    radius: float | None
    """float [m] or None: radius of a ball, None for any other body."""
    turn: Array | None
    """(3, 3) or None: rotation from the coordinates of the solid to the body's own axes; None if
    they agree."""
    sounding: Sounding | None = None
    """Its modes, once they are found; None if it is silent."""

    @property
    def solid(self) -> SoundingSolid | None:
        """Its modes, None if it is silent."""
        return None if self.sounding is None else self.sounding.solid

    @property
    def listening(self) -> Listening | None:
        """Loudness and noise of a design's clips, None without."""
        return None if self.sounding is None else self.sounding.listening

    @property
    def is_as_clips(self) -> bool:
        """Whether its modes are as loud as a design's clips say, in all directions.

        Those of a design for a place move the air, and so are that loud at that place alone.
        """
        return self.listening is not None and self.listening.heard is None

    @property
    def accuracy(self) -> dict[str, Any] | None:
        """Expected errors of the frequencies, see `sound.scenes.solved.SolvedSolid`, if known."""
        return None if self.sounding is None else self.sounding.accuracy

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
        if self.listening is None or not self.is_as_clips:
            return np.ones((len(places), 1))
        return np.array([[self.listening.gain(place)] for place in self.in_solid(places)])


def bodies_of(objects: Sequence[ObjectEntry]) -> list[Body]:
    """The bodies of all objects, without their modes; see `with_modes`.

    Objects that differ in name and motion alone share their modes.  Raises the errors of `body_of`.
    """
    origin = (0.0, 0.0, 0.0)
    made: dict[ObjectEntry, Body] = {}
    bodies = []
    for entry in objects:
        alike = replace(
            entry,
            name="any",
            position=origin,
            rotation=origin,
            velocity=origin,
            spin=origin,
            stands_on=None,
        )
        if alike not in made:
            made[alike] = body_of(entry)
        bodies.append(replace(made[alike], entry=entry))
    return bodies


def body_of(entry: ObjectEntry) -> Body:
    """The body of an object, without its modes.

    Raises UserError if a file is missing or unusable, or a solid has no mass, and ConvergenceError
    if the modes that tell the size of an object with a pitch were not found; both name the object.
    """
    with _naming(entry):
        solid = object_solid(entry)
        if solid.is_held and not entry.fixed:
            raise UserError("is held, so it cannot move; add fixed: true")
        body = _upright_body(entry, solid)
    if not body.mass > LIGHTEST:
        raise UserError(
            f"object {entry.name!r}: has a mass of {body.mass:.3g} kg, expected more than "
            f"{LIGHTEST:g} kg; look at its unit and its density"
        )
    return body


def with_modes(bodies: Sequence[Body]) -> list[Body]:
    """The bodies with their modes, found once for those that share them.

    Raises UserError if there are none, and ConvergenceError if they were not found; both name the
    object.
    """
    found: dict[Callable[[], Sounding], Sounding] = {}
    for body in bodies:
        if body.find is not None and body.find not in found:
            with _naming(body.entry):
                found[body.find] = body.find()
    return [
        body if body.find is None else replace(body, sounding=found[body.find]) for body in bodies
    ]


@contextmanager
def _naming(entry: ObjectEntry) -> Iterator[None]:
    """Let errors name an object."""
    try:
        yield
    except UserError as error:
        raise UserError(f"object {entry.name!r}: {in_keys(str(error))}") from None
    except ConvergenceError as error:
        raise ConvergenceError(f"object {entry.name!r}: {error}") from None


def _upright_body(entry: ObjectEntry, solid: ObjectSolid) -> Body:
    rigid, turn = solid.rigid, solid.turn
    inertia = (rigid.axes * rigid.moments) @ rigid.axes.T
    shape = Shape.of_surface(solid.vertices, solid.faces, rigid.centre, solid.radius)
    if turn is not None:
        inertia = turn @ inertia @ turn.T
        shape = replace(shape, vertices=shape.vertices @ turn.T, inward=shape.inward @ turn.T)
    if solid.radius is not None:
        parts = []
    elif entry.collision == "hull":
        parts = [hull_of(shape.vertices)]
    else:
        parts = convex_parts(shape.vertices, shape.faces)
    which = np.zeros(len(shape.vertices), dtype=np.int64)
    of_parts = [0] * max(1, len(parts))
    if solid.which is not None:
        which = np.asarray(solid.which)
        parts, of_parts = parts_of_one(parts, shape.vertices, which)
    return Body(
        entry,
        rigid.mass,
        inertia,
        rigid.centre,
        shape,
        compliance(solid.young, solid.poisson),
        solid.materials,
        which,
        parts,
        tuple(of_parts),
        cylinder_of(parts[0]) if len(parts) == 1 else None,
        solid.volume,
        solid.find,
        solid.radius,
        turn,
    )
