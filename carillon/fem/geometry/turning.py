"""Surfaces turned so that an axis of their file points up, which is z."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from carillon.arrays import Array, Surface

Y_UP = (".gltf", ".glb")
"""Endings of mesh files whose y points up (glTF 2.0, section 3.4)."""
UNTOLD = (".obj", ".off", ".ply", ".stl")
"""Endings of mesh files that say nothing of what points up."""
STANDS = 0.02
"""Part of a height that a solid may reach below 0 along the axis that it stands on 0 of."""
HANGS = 0.25
"""Part of a height on each side of 0 from which a solid does not stand on 0."""

_ROTATIONS = {
    "x": ((0, 0, -1), (0, 1, 0), (1, 0, 0)),
    "y": ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    "z": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "-x": ((0, 0, 1), (0, 1, 0), (-1, 0, 0)),
    "-y": ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
    "-z": ((1, 0, 0), (0, -1, 0), (0, 0, -1)),
}


def upright_rotation(up: str) -> Array:
    """Rotation (3, 3) from axes whose `up` points up to axes whose z does.

    `up`: one of `carillon.parameters.quantities.UP_AXES`. Entries are -1, 0 and 1, so coordinates
    are exchanged without rounding.

    Examples
    --------
    >>> upright_rotation("y") @ [0.0, 1.0, 0.0]
    array([0., 0., 1.])
    """
    return np.array(_ROTATIONS[up], dtype=float)


def turned_points(points: Array, up: str | None) -> Array:
    """Points or directions (n, 3), turned by `upright_rotation`; None leaves them as they are.

    Examples
    --------
    >>> turned_points(np.array([[0.1, 0.2, 0.3]]), "y").tolist()
    [[0.1, -0.3, 0.2]]
    """
    # Without negative zeros.
    return points if up is None else points @ upright_rotation(up).T + 0.0


def turned_back(points: Array, up: str | None) -> Array:
    """Points or directions (n, 3) that `turned_points` turns to those given.

    Examples
    --------
    >>> turned_back(np.array([[0.1, -0.3, 0.2]]), "y").tolist()
    [[0.1, 0.2, 0.3]]
    """
    return points if up is None else points @ upright_rotation(up) + 0.0


def remaining_turn(
    mesh: str = "", up: str | None = None, turned: str | None = None
) -> Array | None:
    """Rotation (3, 3) that a solid still needs for z to point up; None if it stands upright.

    `mesh` is the file that the solid was made of, `up` the axis of that file that points up, and
    `turned` the axis of it that was turned to z when the solid was made, if one was. Without `up`,
    `turned` counts, then what the format of the file says, then z.

    Examples
    --------
    >>> remaining_turn("bar.glb") @ [0.0, 1.0, 0.0]
    array([0., 0., 1.])
    >>> remaining_turn("bar.obj") is None, remaining_turn("bar.glb", turned="y") is None
    (True, True)
    >>> remaining_turn("bar.obj", "x", "x") is None
    True
    """
    up = up or turned or up_of_format(mesh) or "z"
    before = "z" if turned is None else turned
    if up == before:
        return None
    return upright_rotation(up) @ upright_rotation(before).T + 0.0


def turned_upright(surface: Surface, up: str | None) -> Surface:
    """A surface whose vertices are turned by `upright_rotation`; its faces stay as they are.

    `up`: axis that points up, one of `carillon.parameters.quantities.UP_AXES`; None returns the
    surface itself.

    Examples
    --------
    >>> from carillon.fem.geometry.builtin import builtin_surface
    >>> turned_upright(builtin_surface("box"), "y").extents.round(3).tolist()
    [0.2, 0.1, 0.15]
    """
    if up is None:
        return surface
    vertices = turned_points(np.asarray(surface.vertices), up)
    return type(surface)(vertices, np.asarray(surface.faces), process=False)


def up_of_format(mesh: str) -> str | None:
    """Axis that points up in files of a mesh's format; None if the format does not say.

    Examples
    --------
    >>> up_of_format("bar.GLB"), up_of_format("bar.obj")
    ('y', None)
    """
    return "y" if Path(mesh).suffix.lower() in Y_UP else None


def likely_up(mesh: str, bounds: Sequence[Sequence[float]] | Array) -> str | None:
    """`y` if a mesh seems to stand on y = 0, as it was made where y points up; None if not.

    It begins at y = 0 and lies on both sides of z = 0. Of formats that say what points up, and of
    built-in objects, nothing is guessed. `bounds` (2, 3): of the mesh in its file's axes.

    Examples
    --------
    >>> likely_up("teapot.obj", [[-3.0, 0.0, -2.0], [3.4, 3.15, 2.0]])
    'y'
    >>> likely_up("teapot.obj", [[-3.0, -2.0, 0.0], [3.4, 2.0, 3.15]]) is None
    True
    """
    if Path(mesh).suffix.lower() not in UNTOLD:
        return None
    low, high = np.asarray(bounds, dtype=float)
    height = high - low
    stands = low[1] >= -STANDS * height[1]
    hangs = low[2] <= -HANGS * height[2] and high[2] >= HANGS * height[2]
    return "y" if stands and hangs else None
