"""The result of playing a scene: surfaces, motion and camera, sound and impacts."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array
from carillon.files.atomic import atomic_path
from sound.levels import SoundLevel
from sound.scenes.scene import GROUND_NAME

GROUND = -1
"""Number that stands for the ground in pairs of bodies."""
COLUMNS = (
    "time_seconds",
    "first",
    "second",
    "x_m",
    "y_m",
    "z_m",
    "impulse_newton_seconds",
    "approach_metres_per_second",
    "duration_seconds",
)


@dataclass(frozen=True)
class Appearance:
    """The surface of a named object of the scene.

    `vertices` (V, 3) [m] of the triangles `faces` (F, 3) are in the object's own axes, from its
    centre of mass; `colour` (3,) is red, green and blue from 0 to 1 (sRGB), of most of it.  Where
    it is of several colours, `colours` (k, 3) are these, and `painted` (F,) the number of each
    triangle's.
    """

    name: str
    vertices: Array
    faces: NDArray[np.integer]
    colour: tuple[float, float, float]
    colours: tuple[tuple[float, float, float], ...] = ()
    painted: NDArray[np.integer] | None = None

    @classmethod
    def of_regions(
        cls,
        name: str,
        vertices: Array,
        faces: NDArray[np.integer],
        colours: Sequence[tuple[float, float, float]],
        which: NDArray[np.integer],
    ) -> Appearance:
        """A surface whose vertices have the colours of these numbers (V,)."""
        distinct = tuple(dict.fromkeys(colours))
        own = np.array([distinct.index(colour) for colour in colours])[which]
        if len(distinct) == 1:
            return cls(name, vertices, faces, distinct[0])
        # What two corners have, or the first.
        first, second, third = own[faces].T
        painted = np.where(second == third, second, first)
        sides = vertices[faces[:, 1:]] - vertices[faces[:, :1]]
        areas = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
        most = int(np.bincount(painted, areas, len(distinct)).argmax())
        return cls(name, vertices, faces, distinct[most], distinct, painted)


@dataclass(frozen=True)
class Motion:
    """Positions (T, B, 3) [m] of the centres of mass of B objects at T times [s], at equal steps
    from 0; z points up.

    `rotations` (T, B, 4) are unit quaternions (w, x, y, z) that turn an object's own axes to those
    of the scene.
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
    """The camera: its position (3,) [m], the target (3,) [m] in the middle of the picture, and its
    vertical field of view.
    """

    position: tuple[float, float, float]
    target: tuple[float, float, float]
    degrees: float = 36.0


@dataclass(frozen=True)
class Picture:
    """The visible part of a scene: surfaces of its objects, in the order of their motion, the
    height of the ground [m] or None, and the camera.
    """

    objects: list[Appearance]
    motion: Motion
    ground: float | None
    camera: Camera

    def end_speeds(self) -> dict[str, float]:
        """Speed [m/s] of the fastest vertex of each object at the end of the motion, by name.

        Examples
        --------
        >>> ends = np.array([[[0.0, 0.0, 0.0]], [[0.0, 0.0, 0.5]]])
        >>> still = np.array([[[1.0, 0.0, 0.0, 0.0]]] * 2)
        >>> motion = Motion(np.array([0.0, 0.5]), ends, still)
        >>> box = Appearance("box", np.eye(3), np.array([[0, 1, 2]]), (1.0, 1.0, 1.0))
        >>> Picture([box], motion, None, Camera((1.0, 0.0, 0.0), (0.0, 0.0, 0.0))).end_speeds()
        {'box': 1.0}
        """
        from scipy.spatial.transform import Rotation

        motion = self.motion
        if len(motion.times) < 2:
            return {}
        seconds = motion.times[-1] - motion.times[-2]
        speeds = {}
        for number, each in enumerate(self.objects):
            turns = Rotation.from_quat(motion.rotations[-2:, number][:, [1, 2, 3, 0]])
            before, after = (
                turn.apply(each.vertices) + place
                for turn, place in zip(turns, motion.positions[-2:, number])
            )
            fastest = np.linalg.norm(after - before, axis=1).max()
            speeds[each.name] = float(fastest / seconds)
        return speeds


class Impact(NamedTuple):
    """An impact of a pair of bodies by numbers, of which the ground, `GROUND`, is always the
    second.

    It begins at a time [s], at a position (3,) [m] in the scene and a speed of approach [m/s]; the
    impulse (3,) [N s] is that on the first body, and the duration [s] of the contact is Hertz's.
    """

    seconds: float
    pair: tuple[int, int]
    position: Array
    impulse: Array
    speed: float
    duration: float


@dataclass(frozen=True)
class Voice:
    """The sound of an object that is struck by hand: frequencies (N,) [Hz] and dampings d (N,)
    [1/s].

    `gains` (V, N) [full scale] are amplitudes of the modes one metre away after 1 N s inwards at
    each vertex of the surface, as loud as in the scene's sound; they fall as exp(-d t).
    """

    frequencies: Array
    dampings: Array
    gains: Array


@dataclass(frozen=True)
class Performance:
    """A scene that was played."""

    title: str
    picture: Picture
    """Title of the scene; surfaces, motion and camera."""
    sound: Array
    rate: int
    """(s, 2) [full scale], int [Hz]: sound at the left and the right ear, and samples per
    second."""
    impacts: list[Impact]
    """Impacts in the order of time, without rolling and sliding."""
    voices: list[Voice | None]
    scale: float = 1.0
    """B voices, float [1/Pa]: sounds of the objects, None for a silent one; full scale per
    pascal."""
    timings: dict[str, float] = field(default_factory=dict)
    """dict [s]: wall time of each step of the work."""
    accuracies: list[dict[str, Any] | None] = field(default_factory=list)
    """B dicts: expected errors of each object's frequencies, see
    `sound.scenes.solved.SolvedSolid`; None for a silent object, or if they are unknown."""
    moved: dict[str, list[float]] = field(default_factory=dict)
    """dict: displacements (3,) [m] of overlapping objects that were separated at the start, by
    name."""
    level: SoundLevel | None = None
    """Loudness, peak and end of the sound; None if unknown."""


def linear_light(colour: Sequence[float]) -> Array:
    """Light of a colour (3,) in sRGB, both from 0 to 1 (IEC 61966-2-1).

    Examples
    --------
    >>> linear_light((0.0, 0.5, 1.0)).round(4).tolist()
    [0.0, 0.214, 1.0]
    """
    parts = np.array(colour, dtype=float)
    return np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)


def write_impacts(path: str | Path, performance: Performance) -> None:
    """Write when, where and how hard what struck what; the ground has the name `ground`.

    Raises UserError if the file cannot be written.
    """
    names = [each.name for each in performance.picture.objects]
    with atomic_path(path) as temporary, open(temporary, "w", newline="") as file:
        table = csv.writer(file)
        table.writerow(COLUMNS)
        for impact in performance.impacts:
            pair = [GROUND_NAME if each == GROUND else names[each] for each in impact.pair]
            strength = float(np.linalg.norm(impact.impulse))
            numbers = [strength, impact.speed, impact.duration]
            table.writerow(
                [f"{impact.seconds:.6f}", *pair]
                + [f"{value:.6g}" for value in (*impact.position, *numbers)]
            )
