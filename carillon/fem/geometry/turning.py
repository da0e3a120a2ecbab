"""Surfaces turned so that an axis of their file points up, which is z."""

import numpy as np

from carillon.arrays import Array, Surface

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
