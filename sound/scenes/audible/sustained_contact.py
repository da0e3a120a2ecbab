"""Sustained forces between bodies: their fluctuation by rough surfaces, and their dashpots."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, lfilter

from carillon.arrays import Array
from sound.scenes.audible.contact_damping import dashpot
from sound.scenes.audible.roughness import profile
from sound.scenes.contact.contacts import ContactPoints
from sound.scenes.contact.impacts import SustainedContact
from sound.scenes.hertz import patch_radius, stiffness
from sound.synthesis.driven import BLOCK

Integers = NDArray[np.int64]

LOWEST_HERTZ = 20.0
"""Frequency [Hz] below which fluctuations of a force are filtered out, as they are not heard."""


@dataclass(frozen=True)
class SustainedForce:
    """The sustained force between two bodies, in blocks of samples.

    Attributes
    ----------
    pair
        Numbers of the bodies.
    contacts, vertices, shares
        Points of contact in the order of time, nearest vertices of both bodies, and sustained
        shares of the forces.
    blocks : (b,)
        Numbers of the blocks with a force, ascending.
    firsts : (b,)
        Number of the first point in each block.
    steps : (b,)
        Number of the engine's steps with a force in each block.
    courses : (b, BLOCK)
        Fluctuation of the force over its mean.
    dashpots : (b,) [N s/m]
        Dashpot of the contact in each block.
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
        """Sums of values (c, ...) over the points of each block, mean over its steps (b, ...)."""
        steps = self.steps.reshape(-1, *(1,) * (values.ndim - 1))
        return np.asarray(np.add.reduceat(values, self.firsts, axis=0) / steps)


def sustained_force(
    contact: SustainedContact,
    roughness: float,
    seconds: float,
    step_seconds: float,
    rate: int,
    seed: int,
) -> SustainedForce | None:
    """The sustained force of a pair of bodies; None if there is none.

    A bump of the height h presses the bodies together by another h, which changes their force by h
    times the stiffness of the contact, at most by all of it.

    Parameters
    ----------
    contact
        Contacts of the pair.
    roughness : float [m]
        Root mean square height of both surfaces together.
    seconds, step_seconds : float [s]
        Duration of the scene, and of a step of the simulation.
    rate : int [Hz]
        Samples per second.
    seed : int
        Seed of the scene's random surfaces.
    """
    times = contact.contacts.steps * step_seconds
    chosen = np.flatnonzero((contact.shares > 0.0) & (times < seconds))
    if not len(chosen):
        return None
    contacts, shares = contact.contacts[chosen], contact.shares[chosen]
    blocks, firsts = np.unique((times[chosen] * rate).astype(np.int64) // BLOCK, return_index=True)
    new_step = np.diff(contacts.steps, prepend=-1) > 0
    steps = np.add.reduceat(new_step.astype(np.int64), firsts)
    forces = np.add.reduceat(shares * contacts.pressures, firsts) / steps
    points = np.add.reduceat(np.ones(len(contacts)), firsts)
    radius = 1.0 / float(contact.spots.curvatures[chosen].mean())
    modulus = 1.0 / float(contact.spots.compliances[chosen].mean())
    sliding = contacts.velocities - (
        np.einsum("ci,ci->c", contacts.velocities, contacts.normals)[:, None] * contacts.normals
    )
    pace = np.linalg.norm(sliding, axis=1) + radius * contacts.turning
    speeds = np.add.reduceat(pace, firsts) / points
    springs = stiffness(forces, radius, modulus)
    heights = profile(
        _way(np.cumsum(speeds) * BLOCK / rate, speeds * BLOCK / rate),
        np.repeat(speeds, BLOCK),
        np.repeat(2.0 * patch_radius(forces, radius, modulus), BLOCK),
        roughness,
        _seed(seed, contact.pair),
        rate,
    )
    fluctuation = np.clip(heights * np.repeat(springs / forces, BLOCK), -1.0, 1.0)
    b, a = butter(1, LOWEST_HERTZ, "highpass", fs=rate)
    courses = lfilter(b, a, fluctuation - fluctuation[0]).reshape(-1, BLOCK)
    dashpots = dashpot(forces, radius, modulus, float(np.median(contacts.masses)))
    vertices = contact.spots.vertices[chosen]
    return SustainedForce(
        contact.pair, contacts, vertices, shares, blocks, firsts, steps, courses, dashpots
    )


def _way(ends: Array, steps: Array) -> Array:
    """Distances (b * BLOCK,) covered at each sample, by those at the end and within each block."""
    shares = (np.arange(BLOCK) + 1.0) / BLOCK - 1.0
    return np.asarray((ends[:, None] + steps[:, None] * shares).ravel())


def _seed(seed: int, pair: tuple[int, int]) -> int:
    words = np.random.SeedSequence([seed, pair[0] + 1, pair[1] + 1]).generate_state(1, np.uint64)
    return int(words[0])
