"""Plays a scene: bodies move, contacts excite their modes, two ears hear them."""

from __future__ import annotations

import time
from typing import Literal

import numpy as np

from carillon.command_line.progress import say
from carillon.errors import UserError
from carillon.processes.threads import allowed_threads, blas_threads
from sound.scenes.audible.loudness import voice
from sound.scenes.bodies import bodies_of
from sound.scenes.contact.engine import GroundPlane, simulate
from sound.scenes.contact.impacts import split_impacts
from sound.scenes.contact.touch import Touch
from sound.scenes.performance import Performance
from sound.scenes.picture import Appearance, Picture
from sound.scenes.playing.scene_sound import SceneSound, gains_of, sustained_forces
from sound.scenes.playing.viewpoint import camera_of, head_of
from sound.scenes.scene import Scene

FULL = 0.99
"""Largest magnitude of a sound that is scaled to full scale; rounding does not take it to 1."""


@blas_threads(1)
def perform(scene: Scene, threads: int | None = None, visible: bool = True) -> Performance:
    """Play a scene from its beginning to its end.

    The result is the same, bit for bit, on any number of threads.

    Parameters
    ----------
    scene
        The scene.
    threads
        Number of threads that share the bodies; that of the cores if None.
    visible
        Whether progress is shown.

    Raises
    ------
    UserError
        If an object is unusable, two overlap at the start, or nothing touches anything.
    """
    threads = threads or allowed_threads()
    seconds, engine, settings = scene.seconds, scene.engine, scene.sound
    clock = Clock()
    bodies = bodies_of(scene.objects)
    clock.lap("bodies")
    ground = GroundPlane(scene.ground, scene.ground_material)
    course = simulate(bodies, seconds, engine, scene.gravity, ground, visible)
    clock.lap("motion")
    if not len(course.contacts):
        raise UserError(
            f"nothing touches anything within {seconds:g} s, so nothing sounds; let the "
            "scene last longer, or let objects meet"
        )
    touch = Touch(bodies, ground.material)
    impacts, contacts = split_impacts(course.contacts, touch, engine, scene.gravity)
    clock.lap("contacts")
    camera = camera_of(scene.camera, bodies, course.motion)
    player = SceneSound(
        bodies,
        course,
        impacts,
        contacts,
        sustained_forces(
            contacts, bodies, ground.material, seconds, engine, settings.rate, scene.seed, threads
        ),
        gains_of(bodies, settings.radiation, threads),
        head_of(scene.listener, camera),
        settings,
        engine,
        round(seconds * settings.rate),
    )
    sound = player.together(threads)
    clock.lap("sound")
    scale = _scale(settings.full_scale, float(np.abs(sound).max(initial=0.0)))
    voices = [
        None if body.solid is None else voice(body, scale * gains)
        for body, gains in zip(bodies, player.gains)
    ]
    clock.lap("voices")
    surfaces = [
        Appearance(
            each.entry.name, each.shape.vertices, each.shape.faces, each.entry.made_of.colour
        )
        for each in bodies
    ]
    return Performance(
        scene.title,
        Picture(surfaces, course.motion, scene.ground, camera),
        scale * sound,
        settings.rate,
        [each.impact for each in impacts],
        voices,
        scale,
        clock.seconds,
        [body.accuracy for body in bodies],
        {bodies[number].entry.name: way.tolist() for number, way in course.moved.items()},
    )


class Clock:
    """Wall time of steps, one after the other."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._last = time.perf_counter()

    def lap(self, step: str) -> None:
        """Note the time since the last lap as that of a step."""
        now = time.perf_counter()
        self.seconds[step] = now - self._last
        self._last = now


def _scale(full_scale: float | Literal["auto"], peak: float) -> float:
    """Full scale per pascal, from the pressure [Pa] of full scale and of the loudest sample."""
    if peak == 0.0:
        return 1.0
    if full_scale == "auto":
        return FULL / peak
    if peak > FULL * full_scale:
        say(
            f"the loudest sample has {peak:.3g} Pa, more than full_scale ({full_scale:g} Pa): all "
            f"is {20.0 * np.log10(peak / (FULL * full_scale)):.1f} dB fainter, so that "
            "nothing clips"
        )
        return FULL / peak
    return 1.0 / full_scale
