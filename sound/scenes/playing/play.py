"""Plays a scene: bodies move, contacts excite modes, a head hears them."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from carillon.command_line.progress import say
from carillon.errors import UserError
from carillon.processes.cores import allowed_threads
from carillon.processes.serial import serial_blas
from carillon.processes.threads import in_parallel
from sound.scenes.audible.excitation import excitation
from sound.scenes.audible.hearing import Head, along, heard, towards
from sound.scenes.audible.loudness import CHANNELS, click, clip_noise, mode_gains, voice
from sound.scenes.audible.resting_contact import rests_of
from sound.scenes.audible.ringing import ring
from sound.scenes.audible.sustained_contact import pressed
from sound.scenes.bodies import Body, body_of
from sound.scenes.contact.engine import Course, simulate
from sound.scenes.contact.impacts import Blow, Pressing, told_apart
from sound.scenes.contact.touch import Touch
from sound.scenes.performance import GROUND, Performance
from sound.scenes.picture import Appearance, Picture
from sound.scenes.playing.viewpoint import camera_of, head_of
from sound.scenes.scene import ObjectEntry, Scene

Array = NDArray[np.float64]

AT_ONCE = 16
"""Bodies whose sounds are kept before they are added up."""
FULL = 0.99
"""Largest magnitude of a sound that is scaled to full scale: what rounds it does not reach 1."""


@serial_blas
def perform(scene: Scene, threads: int | None = None, visible: bool = True) -> Performance:
    """A scene from its beginning to its end; the same, bit for bit, on any number of threads.

    Parameters
    ----------
    threads
        That bodies are shared among; as many as there are cores unless told.
    visible
        Whether progress is told.

    Raises
    ------
    UserError
        If an object is unusable, two overlap at the start, or nothing touches anything.
    """
    threads = threads or allowed_threads()
    clock = Clock()
    bodies = bodies_of(scene)
    clock.lap("bodies")
    course = simulate(scene, bodies, visible)
    clock.lap("motion")
    if not len(course.contacts):
        raise UserError(
            f"nothing touches anything within {scene.seconds:g} s, so nothing sounds; let the "
            "scene last longer, or let objects meet"
        )
    blows, lasting = told_apart(course.contacts, scene, Touch(bodies, scene.ground_material))
    clock.lap("contacts")
    player = _Player(scene, bodies, course, blows, lasting, threads)
    sound = player.heard_together(threads)
    clock.lap("sound")
    scale = _scale(scene, float(np.abs(sound).max(initial=0.0)))
    voices = [
        None if body.solid is None else voice(body, scale * player.gains[number])
        for number, body in enumerate(bodies)
    ]
    clock.lap("voices")
    return Performance(
        scene.title,
        Picture(
            [
                Appearance(
                    each.entry.name, each.shape.vertices, each.shape.faces, each.entry.colour
                )
                for each in bodies
            ],
            course.motion,
            scene.ground,
            player.camera,
        ),
        scale * sound,
        scene.sound.rate,
        [blow.impact for blow in blows],
        voices,
        scale,
        clock.seconds,
        [body.accuracy for body in bodies],
        {bodies[number].entry.name: way.tolist() for number, way in course.moved.items()},
    )


class Clock:
    """Wall time of one thing after the other."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._last = time.perf_counter()

    def lap(self, what: str) -> None:
        """What took the time since the last lap."""
        now = time.perf_counter()
        self.seconds[what] = now - self._last
        self._last = now


def bodies_of(scene: Scene) -> list[Body]:
    """Bodies of all objects; those that are alike but for their places share their modes.

    Raises
    ------
    UserError
        See `sound.scenes.bodies.body_of`.
    """
    made: dict[ObjectEntry, Body] = {}
    bodies = []
    for entry in scene.objects:
        nowhere = (0.0, 0.0, 0.0)
        alike = replace(
            entry, name="", position=nowhere, rotation=nowhere, velocity=nowhere, spin=nowhere
        )
        if alike not in made:
            made[alike] = body_of(entry)
        body = made[alike]
        bodies.append(replace(body, entry=replace(entry, radius=body.entry.radius)))
    return bodies


class _Player:
    """Lets bodies sound, one at a time."""

    def __init__(
        self,
        scene: Scene,
        bodies: list[Body],
        course: Course,
        blows: list[Blow],
        lasting: list[Pressing],
        threads: int,
    ) -> None:
        self.scene, self.bodies, self.course = scene, bodies, course
        self.lasting = lasting
        self.blows: list[list[Blow]] = [[] for _ in bodies]
        for blow in blows:
            for number in blow.impact.pair:
                if number != GROUND:
                    self.blows[number].append(blow)
        found = in_parallel(pressed, [(each, bodies, scene) for each in lasting], threads)
        self.pressings = [each for each in found if each is not None]
        self.count = round(scene.seconds * scene.sound.rate)
        self.camera = camera_of(scene, bodies, course.motion)
        self.head: Head = head_of(scene, self.camera)
        self.gains = _gains(bodies, scene.sound.radiation, threads)

    def heard_together(self, threads: int) -> Array:
        """What two ears (count, 2) hear of all bodies, added up in their order."""
        sound = np.zeros((self.count, 2))
        for first in range(0, len(self.bodies), AT_ONCE):
            last = min(first + AT_ONCE, len(self.bodies))
            for part in in_parallel(self.heard, [(each,) for each in range(first, last)], threads):
                sound += part
        return sound

    def heard(self, number: int) -> Array:
        """What two ears (count, 2) hear of a body."""
        source = self.source(number)
        if not self.scene.sound.space:
            return np.repeat(source[:, None], 2, axis=1)
        return heard(source, self.course.motion, number, self.head, self.scene.sound.rate)

    def source(self, number: int) -> Array:
        """Pressure times distance (count,) [Pa m] of a body, in the direction of the head."""
        scene, body, motion = self.scene, self.bodies[number], self.course.motion
        rate = scene.sound.rate
        times, directions = motion.times, towards(motion, number, self.head)
        total = np.zeros(self.count)
        if scene.sound.radiation:
            jerked = click(number, body, self.blows[number], self.count, rate)
            total += along(jerked, rate * times, directions)
        if body.solid is None:
            return total
        moved = body.motion(body.shape.vertices)
        resting = self.course.resting[:, number]
        rests = rests_of(number, moved, self.lasting, times, resting, scene)
        act = excitation(
            number,
            body,
            moved,
            self.blows[number],
            self.pressings,
            rests,
            self.count,
            rate,
            signed=scene.sound.radiation and body.listening is None,
            damped=scene.sound.contact_damping,
        )
        gains = self.gains[number]
        modes = ring(body.solid.frequencies, body.solid.dampings, gains, act, self.count, rate)
        total += modes[:, 0]
        if gains[:, 1:].any():
            turned = np.einsum("tij,ti->tj", _matrices(motion.rotations[:, number]), directions)
            total += along(modes[:, 1:], rate * times, turned)
        if body.listening is not None and scene.sound.noise:
            own = self.blows[number]
            total += clip_noise(number, body, own, float(gains[0, 0]), self.count, rate)
        return total


def _gains(bodies: list[Body], radiation: bool, threads: int) -> list[Array]:
    """Gains of the modes of all bodies; those of bodies that are alike are found once."""
    sounding = {id(body.solid): body for body in bodies if body.solid is not None}
    arguments = [(body, radiation) for body in sounding.values()]
    found = dict(zip(sounding, in_parallel(mode_gains, arguments, threads)))
    levels = [10.0 ** (body.entry.level / 20.0) for body in bodies]
    silent = np.zeros((0, CHANNELS))
    return [found.get(id(body.solid), silent) * level for body, level in zip(bodies, levels)]


def _matrices(quaternions: Array) -> Array:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_quat(quaternions[:, [1, 2, 3, 0]]).as_matrix())


def _scale(scene: Scene, peak: float) -> float:
    """Full scale per pascal."""
    wanted = scene.sound.full_scale
    if peak == 0.0:
        return 1.0
    if wanted is None:
        return FULL / peak
    if peak > FULL * wanted:
        say(
            f"the loudest sample has {peak:.3g} Pa, more than full_scale ({wanted:g} Pa): all is "
            f"{20.0 * np.log10(peak / (FULL * wanted)):.1f} dB fainter, so that nothing clips"
        )
        return FULL / peak
    return 1.0 / wanted
