"""Camera and head of a scene, where its description leaves them out."""

from __future__ import annotations

import numpy as np

from carillon.arrays import Array
from sound.scenes.audible.hearing import Head
from sound.scenes.body import Body
from sound.scenes.picture import Camera, Motion
from sound.scenes.scene import CameraEntry, ListenerEntry

FROM = np.array([0.25, -1.0, 0.42]) / np.linalg.norm([0.25, -1.0, 0.42])
"""Unit vector to the camera: in front, a little to the right and above."""
_RIGHT = np.cross([0.0, 0.0, 1.0], FROM) / np.hypot(FROM[0], FROM[1])
AXES = np.stack([_RIGHT, np.cross(FROM, _RIGHT)])
"""Unit vectors to the right and up in the picture."""
ASPECT = 16.0 / 9.0
"""Width over height of the part of the picture that shows the scene."""
ROOM = 1.15
"""Size of the picture over that of the scene in it."""
MOST = 0.8
"""Share of all positions that the picture shows, those nearest to the median; bodies that roll away
are left out."""


def camera_of(entry: CameraEntry, bodies: list[Body], motion: Motion) -> Camera:
    """The camera of a scene; it shows nearly all of the motion unless its entry says otherwise.

    From the distance d to the target u, a ball of radius r at x is inside the picture if
    |a.(x - u)| + r <= s (d - b.(x - u)) for both axes a of the picture, where b points to the
    camera and s is the slope of the picture's edge.  Along one axis, d is least where the balls on
    either side need the same distance.
    """
    if entry.position is not None and entry.target is not None:
        return Camera(entry.position, entry.target, entry.degrees)
    sizes = np.array([np.linalg.norm(body.shape.vertices, axis=1).max() for body in bodies])
    places = motion.positions.reshape(-1, 3)
    away = np.linalg.norm(places - np.median(places, axis=0), axis=1)
    near = away <= np.quantile(away, MOST)
    near[: len(bodies)] = True  # all initial positions
    seen, reach = places[near], np.resize(sizes, len(places))[near]
    middle = 0.5 * (seen.min(axis=0) + seen.max(axis=0))
    if entry.position is not None:
        return Camera(entry.position, _three(middle), entry.degrees)
    target = middle if entry.target is None else np.array(entry.target)
    slopes = np.tan(np.radians(entry.degrees) / 2.0) * np.array([ASPECT, 1.0]) / ROOM
    aside = (seen - target) @ AXES.T
    needed = reach[:, None] + slopes * ((seen - target) @ FROM)[:, None]
    ahead, behind = (needed + aside).max(axis=0), (needed - aside).max(axis=0)
    if entry.target is None:
        target = target + 0.5 * (ahead - behind) @ AXES
        ahead = behind = 0.5 * (ahead + behind)
    distance = (np.maximum(ahead, behind) / slopes).max()
    return Camera(_three(target + distance * FROM), _three(target), entry.degrees)


def head_of(entry: ListenerEntry, camera: Camera) -> Head:
    """The listener's head: at the camera and facing its target unless the entry says otherwise."""
    facing = np.array(camera.target if entry.facing is None else entry.facing)
    if entry.path is not None:
        path = np.array(entry.path)
        return Head(path[:, 0], path[:, 1:], facing)
    place = camera.position if entry.position is None else entry.position
    return Head(np.zeros(1), np.array([place]), facing)


def _three(values: Array) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z
