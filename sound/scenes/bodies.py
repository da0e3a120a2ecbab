"""The bodies of a scene's objects: solids set upright, with what collides of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from carillon.arrays import Array
from carillon.errors import ConvergenceError, UserError
from sound.scenes.body import Body
from sound.scenes.convex import convex_parts, hull_of
from sound.scenes.hertz import compliance
from sound.scenes.object_solid import ObjectSolid, object_solid
from sound.scenes.scene import ObjectEntry
from sound.scenes.shape import Shape

LIGHTEST = 1e-9
"""Least mass [kg] of a body that the engine of rigid bodies can move."""
Y_UP = (".gltf", ".glb")
"""Endings of mesh files whose y points up.  In all other files z is taken to point up."""
_Y_TO_Z = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Rotation from axes whose y points up to axes whose z does (glTF 2.0, section 3.4)."""


def bodies_of(objects: Sequence[ObjectEntry]) -> list[Body]:
    """The bodies of all objects; objects that differ in name and motion alone share their modes.

    Raises
    ------
    UserError
        See `body_of`.
    ConvergenceError
        See `body_of`.
    """
    origin = (0.0, 0.0, 0.0)
    made: dict[ObjectEntry, Body] = {}
    bodies = []
    for entry in objects:
        alike = replace(
            entry, name="any", position=origin, rotation=origin, velocity=origin, spin=origin
        )
        if alike not in made:
            made[alike] = body_of(entry)
        bodies.append(replace(made[alike], entry=entry))
    return bodies


def body_of(entry: ObjectEntry) -> Body:
    """The body of an object.

    Raises
    ------
    UserError
        If a file is missing or unusable, or a solid has no mass or no modes; names the object.
    ConvergenceError
        If the modes were not found; names the object.
    """
    try:
        body = _upright_body(entry, object_solid(entry))
    except UserError as error:
        raise UserError(f"object {entry.name!r}: {_in_keys(str(error))}") from None
    except ConvergenceError as error:
        raise ConvergenceError(f"object {entry.name!r}: {error}") from None
    if not body.mass > LIGHTEST:
        raise UserError(
            f"object {entry.name!r}: has a mass of {body.mass:.3g} kg, expected more than "
            f"{LIGHTEST:g} kg; look at its unit and its density"
        )
    return body


def _in_keys(sentence: str) -> str:
    """A sentence about options of commands, with keys of a scene in place of the options."""
    keys = {"--resolution": "resolution", "--components largest": "components: largest"}
    for option, key in keys.items():
        sentence = sentence.replace(option, key)
    return sentence


def _upright_body(entry: ObjectEntry, solid: ObjectSolid) -> Body:
    rigid, turn = solid.rigid, upright(solid.mesh)
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
    return Body(
        entry,
        rigid.mass,
        inertia,
        rigid.centre,
        shape,
        compliance(solid.young, solid.poisson),
        parts,
        solid.sounding,
        solid.listening,
        solid.radius,
        turn,
        solid.accuracy,
    )


def upright(mesh: str) -> Array | None:
    """Rotation (3, 3) from the coordinates of a mesh file to axes whose z points up, None if none.

    Examples
    --------
    >>> upright("bar.GLB") @ [0.0, 1.0, 0.0]
    array([0., 0., 1.])
    >>> upright("bar.obj") is None
    True
    """
    return _Y_TO_Z if Path(mesh).suffix.lower() in Y_UP else None
