"""Forces that last, block by block: how they tremble as surfaces are rough, how they damp."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, lfilter

from sound.scenes.audible.damping import dashpot
from sound.scenes.audible.ringing import BLOCK
from sound.scenes.audible.roughness import profile
from sound.scenes.bodies import Body
from sound.scenes.contact.contacts import ContactPoints
from sound.scenes.contact.impacts import Pressing
from sound.scenes.hertz import patch_radius, stiffness
from sound.scenes.performance import GROUND
from sound.scenes.scene import Scene

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

LOWEST_HERTZ = 20.0
"""Below which a force that trembles is not heard."""


@dataclass(frozen=True)
class Pressed:
    """Forces between two objects that last, in blocks of samples.

    Attributes
    ----------
    pair
        Numbers of the objects.
    contacts, vertices, shares
        Points of contact in the order of time, vertices nearest to them, and what of their forces
        lasts.
    blocks : (b,)
        Numbers of the blocks in which there are any, ascending.
    firsts : (b,)
        Number of the first point in each.
    steps : (b,)
        Steps of the engine in each that have any.
    courses : (b, BLOCK)
        How the force comes and goes, over itself.
    dashpots : (b,) [N s/m]
        Force over the speed at which the objects approach.
    """

    pair: tuple[int, int]
    contacts: ContactPoints
    vertices: NDArray[np.integer]
    shares: Array
    blocks: Integers
    firsts: Integers
    steps: Integers
    courses: Array
    dashpots: Array

    def mean(self, values: Array) -> Array:
        """Sums over points of contact (c, ...) in each block, mean over its steps (b, ...)."""
        steps = self.steps.reshape(-1, *(1,) * (values.ndim - 1))
        return np.asarray(np.add.reduceat(values, self.firsts, axis=0) / steps)


def pressed(pressing: Pressing, bodies: list[Body], scene: Scene) -> Pressed | None:
    """The forces of a pair that last; None if there are none.

    A bump of the height h presses two solids by h more together, which changes their force by h
    times the stiffness of the contact, at most by all of it.
    """
    rate, step_seconds = scene.sound.rate, scene.engine.step_seconds
    times = pressing.contacts.steps * step_seconds
    chosen = np.flatnonzero((pressing.shares > 0.0) & (times < scene.seconds))
    if not len(chosen):
        return None
    contacts, shares = pressing.contacts[chosen], pressing.shares[chosen]
    blocks, firsts = np.unique((times[chosen] * rate).astype(np.int64) // BLOCK, return_index=True)
    new_step = np.diff(contacts.steps, prepend=-1) > 0
    steps = np.add.reduceat(new_step.astype(np.int64), firsts)
    forces = np.add.reduceat(shares * contacts.pressures, firsts) / steps
    points = np.add.reduceat(np.ones(len(contacts)), firsts)
    radius = 1.0 / float(pressing.spots.curvatures[chosen].mean())
    modulus = 1.0 / float(pressing.spots.giving[chosen].mean())
    sliding = contacts.velocities - (
        np.einsum("ci,ci->c", contacts.velocities, contacts.normals)[:, None] * contacts.normals
    )
    pace = np.linalg.norm(sliding, axis=1) + radius * contacts.turning
    speeds = np.add.reduceat(pace, firsts) / points
    springs = stiffness(forces, radius, modulus)
    heights = profile(
        _within(np.cumsum(speeds) * BLOCK / rate, speeds * BLOCK / rate),
        np.repeat(speeds, BLOCK),
        np.repeat(2.0 * patch_radius(forces, radius, modulus), BLOCK),
        _roughness(pressing.pair, bodies, scene),
        _seed(scene.seed, pressing.pair),
        rate,
    )
    trembling = np.clip(heights * np.repeat(springs / forces, BLOCK), -1.0, 1.0)
    b, a = butter(1, LOWEST_HERTZ, "highpass", fs=rate)
    courses = lfilter(b, a, trembling - trembling[0]).reshape(-1, BLOCK)
    dashpots = dashpot(forces, radius, modulus, float(np.median(contacts.masses)))
    vertices = pressing.spots.vertices[chosen]
    return Pressed(
        pressing.pair, contacts, vertices, shares, blocks, firsts, steps, courses, dashpots
    )


def _within(ends: Array, steps: Array) -> Array:
    """Ways (b * BLOCK,) that grow evenly in every block to its end, by its step."""
    shares = (np.arange(BLOCK) + 1.0) / BLOCK - 1.0
    return np.asarray((ends[:, None] + steps[:, None] * shares).ravel())


def _roughness(pair: tuple[int, int], bodies: list[Body], scene: Scene) -> float:
    """Of both surfaces together (rms) [m]."""
    own = [
        scene.ground_material.roughness if each == GROUND else bodies[each].entry.roughness
        for each in pair
    ]
    return float(np.hypot(own[0], own[1]))


def _seed(seed: int, pair: tuple[int, int]) -> int:
    words = np.random.SeedSequence([seed, pair[0] + 1, pair[1] + 1]).generate_state(1, np.uint64)
    return int(words[0])
