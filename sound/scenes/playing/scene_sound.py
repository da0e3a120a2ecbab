"""The sound of all bodies of a scene at the ears of its listener."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array
from carillon.processes.threads import in_parallel
from sound.scenes.audible.contact_damping import rests_of
from sound.scenes.audible.excitation import excitation
from sound.scenes.audible.hearing import Head, along, heard, towards
from sound.scenes.audible.loudness import CHANNELS, click, clip_noise, mode_gains
from sound.scenes.audible.sustained_contact import SustainedForce, sustained_force
from sound.scenes.bodies import Body
from sound.scenes.contact.engine import Course
from sound.scenes.contact.impacts import HertzImpact, SustainedContact
from sound.scenes.scene import EngineEntry, SoundEntry
from sound.synthesis.driven import ring

AT_ONCE = 16
"""Number of bodies whose sounds are held in memory before they are added up."""


@dataclass(frozen=True)
class SceneSound:
    """The sound of a scene at the listener's head, body by body, of `count` samples.

    `impacts`, `contacts` by pairs and sustained `forces` are those of the whole scene; `gains` has
    an array (K, CHANNELS) [Pa m] for the modes of each body.
    """

    bodies: Sequence[Body]
    course: Course
    impacts: Sequence[HertzImpact]
    contacts: Sequence[SustainedContact]
    forces: Sequence[SustainedForce]
    gains: Sequence[Array]
    head: Head
    settings: SoundEntry
    engine: EngineEntry
    count: int

    def together(self, threads: int) -> Array:
        """Sound (count, 2) of all bodies at two ears, added up in the order of the bodies."""
        sound = np.zeros((self.count, 2))
        for first in range(0, len(self.bodies), AT_ONCE):
            last = min(first + AT_ONCE, len(self.bodies))
            for part in in_parallel(self.heard, [(each,) for each in range(first, last)], threads):
                sound += part
        return sound

    def heard(self, number: int) -> Array:
        """Sound (count, 2) of a body at two ears."""
        source = self.source(number)
        if not self.settings.space:
            return np.repeat(source[:, None], 2, axis=1)
        return heard(source, self.course.motion, number, self.head, self.settings.rate)

    def source(self, number: int) -> Array:
        """Pressure times distance (count,) [Pa m] of a body, in the direction of the head."""
        body, motion, settings = self.bodies[number], self.course.motion, self.settings
        rate, count = settings.rate, self.count
        frames, directions = rate * motion.times, towards(motion, number, self.head)
        impacts = [each for each in self.impacts if number in each.impact.pair]
        total = np.zeros(count)
        if settings.radiation:
            total += along(click(number, body, impacts, count, rate), frames, directions)
        if body.solid is None:
            return total
        modes = self._modes(number, body, impacts)
        total += modes[:, 0]
        if self.gains[number][:, 1:].any():
            from scipy.spatial.transform import Rotation

            quaternions = motion.rotations[:, number][:, [1, 2, 3, 0]]
            rotations = Rotation.from_quat(quaternions).as_matrix()
            turned = np.einsum("tij,ti->tj", rotations, directions)
            total += along(modes[:, 1:], frames, turned)
        if body.listening is not None and settings.noise:
            gain = float(self.gains[number][0, 0])
            total += clip_noise(number, body, impacts, gain, count, rate)
        return total

    def _modes(self, number: int, body: Body, impacts: Sequence[HertzImpact]) -> Array:
        """Samples (count, CHANNELS) [Pa m] of a body's modes."""
        assert body.solid is not None
        settings, course = self.settings, self.course
        moved = body.motion(body.shape.vertices)
        resting = course.resting[:, number]
        rests = rests_of(number, moved, self.contacts, course.motion.times, resting, self.engine)
        act = excitation(
            number,
            body,
            moved,
            impacts,
            self.forces,
            rests,
            self.count,
            settings.rate,
            signed=settings.radiation and body.listening is None,
            damped=settings.contact_damping,
        )
        frequencies, dampings = body.solid.frequencies, body.solid.dampings
        return ring(frequencies, dampings, self.gains[number], act, self.count, settings.rate)


def sustained_forces(
    contacts: Sequence[SustainedContact],
    seconds: float,
    engine: EngineEntry,
    rate: int,
    seed: int,
    threads: int,
) -> list[SustainedForce]:
    """The sustained forces of all pairs; `sustained_force` describes the parameters."""
    tasks = [(each, seconds, engine.step_seconds, rate, seed) for each in contacts]
    return [each for each in in_parallel(sustained_force, tasks, threads) if each is not None]


def gains_of(bodies: Sequence[Body], radiation: bool, threads: int) -> list[Array]:
    """Gains (K, CHANNELS) [Pa m] of each body's modes, computed once for bodies that share them."""
    sounding = {id(body.solid): body for body in bodies if body.solid is not None}
    tasks = [(body, radiation) for body in sounding.values()]
    gains = dict(zip(sounding, in_parallel(mode_gains, tasks, threads)))
    silent = np.zeros((0, CHANNELS))
    return [
        gains.get(id(each.solid), silent) * 10.0 ** (each.entry.level / 20.0) for each in bodies
    ]
