"""The sound of all bodies of a scene at the ears of its listener."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array
from carillon.processes.threads import in_parallel
from sound.heads.measured_head import MeasuredHead
from sound.radiation.directivity import Directivity
from sound.scenes.audible.contact_damping import rests_of
from sound.scenes.audible.excitation import excitation
from sound.scenes.audible.hearing import Head, along, heard, towards
from sound.scenes.audible.loudness import click, clip_noise, mode_directivity, noise_gain
from sound.scenes.audible.measured_hearing import heard_measured
from sound.scenes.audible.sustained_contact import SustainedForce, sustained_force
from sound.scenes.bodies import Body
from sound.scenes.contact.engine import Course
from sound.scenes.contact.impacts import HertzImpact, SustainedContact
from sound.scenes.scene import EngineEntry, RadiationMethod, SoundEntry
from sound.synthesis.driven import Gains, ring

AT_ONCE = 16
"""Number of bodies whose sounds are held in memory before they are added up."""


@dataclass(frozen=True)
class SceneSound:
    """The sound of a scene at the listener's head, body by body, of `count` samples.

    A `measured` head is heard by in place of a spherical one, if it is not None.  `impacts`,
    `contacts` by pairs and sustained `forces` are those of the whole scene; `directivities`
    [Pa m] are those of each body's modes, None of a silent one.
    """

    bodies: Sequence[Body]
    course: Course
    impacts: Sequence[HertzImpact]
    contacts: Sequence[SustainedContact]
    forces: Sequence[SustainedForce]
    directivities: Sequence[Directivity | None]
    head: Head
    settings: SoundEntry
    engine: EngineEntry
    count: int
    measured: MeasuredHead | None = None

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
        motion, rate = self.course.motion, self.settings.rate
        if self.measured is not None:
            return heard_measured(source, motion, number, self.head, self.measured, rate)
        return heard(source, motion, number, self.head, rate)

    def source(self, number: int) -> Array:
        """Pressure times distance (count,) [Pa m] of a body, in the direction of the head."""
        body, motion, settings = self.bodies[number], self.course.motion, self.settings
        rate, count = settings.rate, self.count
        frames, directions = rate * motion.times, towards(motion, number, self.head)
        impacts = [each for each in self.impacts if number in each.impact.pair]
        total = np.zeros(count)
        if settings.radiation:
            total += along(click(number, body, impacts, count, rate), frames, directions)
        directivity = self.directivities[number]
        if directivity is None:
            return total
        if directivity.is_uniform:
            frames, directions = frames[:1], directions[:1]
        else:
            from scipy.spatial.transform import Rotation

            quaternions = motion.rotations[:, number][:, [1, 2, 3, 0]]
            rotations = Rotation.from_quat(quaternions).as_matrix()
            directions = np.einsum("tij,ti->tj", rotations, directions)
        gains = directivity.towards(directions)
        total += self._modes(number, body, impacts, Gains(frames, gains))
        if body.listening is not None and settings.noise:
            gain = noise_gain(body, directivity)
            total += clip_noise(number, body, impacts, gain, count, rate)
        return total

    def _modes(
        self, number: int, body: Body, impacts: Sequence[HertzImpact], gains: Gains
    ) -> Array:
        """Samples (count,) [Pa m] of a body's modes."""
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
            signed=bool(settings.radiation) and not body.is_as_clips,
            damped=settings.contact_damping,
        )
        frequencies, dampings = body.solid.frequencies, body.solid.dampings
        return ring(frequencies, dampings, gains, act, self.count, settings.rate)


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


def directivities_of(
    bodies: Sequence[Body], radiation: RadiationMethod, threads: int
) -> list[Directivity | None]:
    """Directivity of each body's modes, None of a silent one; found once for those that share them.

    Raises UserError if boundary elements are asked for and not installed.
    """
    sounding = {id(body.solid): body for body in bodies if body.solid is not None}
    tasks = [(body, radiation) for body in sounding.values()]
    # Boundary elements share their work among threads themselves.
    threads = 1 if radiation == "boundary-elements" else threads
    found = dict(zip(sounding, in_parallel(mode_directivity, tasks, threads)))
    return [
        found[id(each.solid)].times(10.0 ** (each.entry.level / 20.0))
        if each.solid is not None
        else None
        for each in bodies
    ]
