"""Plays a scene: bodies move, contacts excite their modes, two ears hear them."""

import sys
import time
from typing import Literal

import numpy as np

from carillon.arrays import Array
from carillon.command_line.progress import say
from carillon.errors import UserError
from carillon.processes.threads import allowed_threads, blas_threads
from sound.heads.measured_head import MeasuredHead, read_head
from sound.levels import FULL, HEARD, SoundLevel, decibels, end_dbfs, faded
from sound.scenes.audible.hearing import Head
from sound.scenes.audible.loudness import voice
from sound.scenes.audible.measured_hearing import unmeasured_share
from sound.scenes.bodies import Body, bodies_of, with_modes
from sound.scenes.contact.engine import GroundPlane, simulate
from sound.scenes.contact.impacts import Touch, split_impacts
from sound.scenes.performance import Appearance, Camera, Motion, Performance, Picture
from sound.scenes.playing.scene_sound import SceneSound, directivities_of, sustained_forces
from sound.scenes.scene import CameraEntry, ListenerEntry, Scene

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


@blas_threads(1)
def perform(
    scene: Scene, threads: int | None = None, visible: bool = True, raw: bool = False
) -> Performance:
    """Play a scene from its beginning to its end, and show progress if `visible`.

    The sound is kept within full scale, and fades where it ends above -60 dBFS, unless it is `raw`:
    full scale is then what the scene says, 1 Pa for `auto`.  With `auto`, a sound that is below the
    threshold of hearing throughout is silence, which a line tells.

    The result is the same, bit for bit, on any number of threads, which is that of the cores if
    None.  Raises UserError if an object is unusable, two overlap at the start, or nothing touches
    anything.
    """
    threads = threads or allowed_threads()
    seconds, engine, settings = scene.seconds, scene.engine, scene.sound
    measured = measured_head_of(scene)
    clock = Clock(visible)
    clock.begin("bodies")
    bodies = bodies_of(scene.objects)
    clock.begin("motion")
    ground = GroundPlane(scene.ground, scene.ground_material)
    course = simulate(bodies, seconds, engine, scene.gravity, ground, visible)
    if not len(course.contacts):
        raise UserError(
            f"nothing touches anything within {seconds:g} s, so nothing sounds; let the "
            "scene last longer, or let objects meet"
        )
    # After the motion, which tells what is wrong with the scene in a moment.
    clock.begin("modes")
    bodies = with_modes(bodies)
    clock.begin("contacts")
    touch = Touch(bodies, ground.material)
    impacts, contacts = split_impacts(course.contacts, touch, engine, scene.gravity)
    clock.begin("sound")
    camera = camera_of(scene.camera, bodies, course.motion)
    head = head_of(scene.listener, camera)
    if measured is not None:
        _say_unmeasured(measured, course.motion, head)
    player = SceneSound(
        bodies,
        course,
        impacts,
        contacts,
        sustained_forces(contacts, seconds, engine, settings.rate, scene.seed, threads),
        directivities_of(bodies, settings.radiation, threads),
        head,
        settings,
        engine,
        round(seconds * settings.rate),
        measured,
    )
    sound = player.together(threads)
    peak = float(np.abs(sound).max(initial=0.0))
    scale = _scale(settings.full_scale, peak, raw)
    sound *= scale
    if settings.full_scale == "auto" and not raw and peak < HEARD:
        say(
            f"the loudest sample has {peak:.3g} Pa, below the threshold of hearing ({HEARD:g} Pa): "
            "the sound is silent; let an object fall, or give one a velocity"
        )
        sound[:] = 0.0
    end = end_dbfs(sound, settings.rate)
    sound, fade = faded(sound, settings.rate, 0.0 if raw else None)
    clock.begin("voices")
    voices = [
        None if directivity is None else voice(body, directivity.times(scale))
        for body, directivity in zip(bodies, player.directivities)
    ]
    clock.end()
    surfaces = [
        Appearance.of_regions(
            each.entry.name,
            each.shape.vertices,
            each.shape.faces,
            [material.colour for material in each.materials],
            each.which,
        )
        for each in bodies
    ]
    return Performance(
        scene.title,
        Picture(surfaces, course.motion, scene.ground, camera),
        sound,
        settings.rate,
        [each.impact for each in impacts],
        voices,
        scale,
        clock.seconds,
        [body.accuracy for body in bodies],
        {bodies[number].entry.name: way.tolist() for number, way in course.moved.items()},
        SoundLevel.of(sound, settings.rate, end, fade),
    )


class Clock:
    """Wall time [s] of steps, one after the other; `visible` tells each one on a terminal."""

    def __init__(self, visible: bool = False) -> None:
        self.seconds: dict[str, float] = {}
        self._visible = visible and sys.stderr.isatty()
        self._step: str | None = None
        self._begin = 0.0

    def begin(self, step: str) -> None:
        """End the present step, and begin another one."""
        self.end()
        self._step, self._begin = step, time.perf_counter()
        say(f"{step:<18s}      ...  ", visible=self._visible, end="\r")

    def end(self) -> None:
        """End the present step, if there is one."""
        if self._step is not None:
            elapsed = self.seconds[self._step] = time.perf_counter() - self._begin
            say(f"{self._step:<18s} {elapsed:8.2f} s", visible=self._visible)
        self._step = None


def _scale(full_scale: float | Literal["auto"], peak: float, raw: bool) -> float:
    """Full scale per pascal, from the pressure [Pa] of full scale and of the loudest sample."""
    if raw:
        return 1.0 if full_scale == "auto" else 1.0 / full_scale
    if full_scale == "auto":
        return FULL / peak if peak >= HEARD else 1.0 / HEARD
    if peak > FULL * full_scale:
        say(
            f"the loudest sample has {peak:.3g} Pa, more than full_scale ({full_scale:g} Pa): all "
            f"is {decibels(peak / (FULL * full_scale)):.1f} dB fainter, so that nothing clips"
        )
        return FULL / peak
    return 1.0 / full_scale


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


def measured_head_of(scene: Scene) -> MeasuredHead | None:
    """The measured head that a scene is heard by; None for a spherical one.

    Raises UserError if its file is unusable.
    """
    file = scene.listener.hrtf
    return None if file is None else read_head(file, float(scene.sound.rate)).equalised()


def _say_unmeasured(measured: MeasuredHead, motion: Motion, head: Head) -> None:
    """Say which share of directions to bodies the head was not measured in, if any."""
    share = unmeasured_share(motion, head, measured)
    if share > 0.0:
        say(
            f"the head {measured.title!r} was not measured in {share:.0%} of the directions to the "
            "objects; the nearest measured ones are heard there"
        )


def _three(values: Array) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z
