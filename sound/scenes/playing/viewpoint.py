"""From where a scene is seen and heard, where it does not say."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sound.scenes.audible.hearing import Head
from sound.scenes.bodies import Body
from sound.scenes.picture import Camera, Motion
from sound.scenes.scene import Scene

Array = NDArray[np.float64]

FROM = np.array([0.25, -1.0, 0.42]) / np.linalg.norm([0.25, -1.0, 0.42])
"""Direction to the camera: in front, a little to the right and above."""
ROOM = 1.15
"""Around what is seen."""
MOST = 0.6
"""Share of all places, the nearest to their median, that must be seen; what rolls away need not."""


def camera_of(scene: Scene, bodies: list[Body], motion: Motion) -> Camera:
    """The camera of a scene, at a place that sees nearly all unless told."""
    entry = scene.camera
    sizes = [np.linalg.norm(body.shape.vertices, axis=1).max() for body in bodies]
    places = motion.positions.reshape(-1, 3)
    away = np.linalg.norm(places - np.median(places, axis=0), axis=1)
    near = places[away <= np.quantile(away, MOST)]
    seen = np.concatenate([motion.positions[0], near])
    low, high = seen.min(axis=0), seen.max(axis=0)
    target = 0.5 * (low + high) if entry.target is None else np.array(entry.target)
    if entry.position is not None:
        return Camera(entry.position, _three(target), entry.degrees)
    radius = 0.5 * float(np.linalg.norm(high - low)) + float(max(sizes))
    distance = ROOM * radius / np.sin(np.radians(entry.degrees) / 2.0)
    return Camera(_three(target + distance * FROM), _three(target), entry.degrees)


def head_of(scene: Scene, camera: Camera) -> Head:
    """Who hears a scene: at the camera, facing what it looks at, unless told."""
    entry = scene.listener
    facing = np.array(camera.target if entry.facing is None else entry.facing)
    if entry.path is not None:
        path = np.array(entry.path)
        return Head(path[:, 0], path[:, 1:], facing)
    place = camera.position if entry.position is None else entry.position
    return Head(np.zeros(1), np.array([place]), facing)


def _three(values: Array) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z
