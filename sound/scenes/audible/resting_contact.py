"""Damping of a body at rest by the bodies that it lies on.

The engine records no contacts of a sleeping body, so the contacts of the last moment before are
taken for it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array
from sound.scenes.audible.contact_damping import dashpot, motion_along
from sound.scenes.contact.impacts import LASTING, SustainedContact
from sound.scenes.scene import EngineEntry


class Rest(NamedTuple):
    """An interval of rest from `begin` to `end` [s], with added dampings (K,) [1/s]."""

    begin: float
    end: float
    dampings: Array


def rests_of(
    number: int,
    motion: Array,
    contacts: Sequence[SustainedContact],
    times: Array,
    resting: NDArray[np.bool_],
    engine: EngineEntry,
) -> list[Rest]:
    """The intervals of rest of a body that sounds, in the order of time.

    Parameters
    ----------
    number
        Number of the body.
    motion : (V, 3, K) [kg^-1/2]
        Displacements of its surface's vertices in each mode.
    contacts
        All contacts of the scene, by pairs.
    times, resting : (T,) [s], (T,)
        Whether the body is at rest at each time.
    engine
        Steps of the simulation.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], resting, [False]]).astype(int)))
    own = [each for each in contacts if number in each.pair]
    rests = []
    for first, after in edges.reshape(-1, 2):
        begin = float(times[first])
        end = float(times[after]) if after < len(times) else float("inf")
        before = float(times[max(0, first - 1)])
        parts = [_damping(number, motion, each, before, begin, engine) for each in own]
        rests.append(Rest(begin, end, np.sum(parts, axis=0)))
    return rests


def _damping(
    number: int,
    motion: Array,
    contact: SustainedContact,
    before: float,
    begin: float,
    engine: EngineEntry,
) -> Array:
    """Dampings (K,) [1/s] by one other body, touched in the last moment before `begin` [s]."""
    width = round(LASTING * engine.steps)
    steps, spots = contact.contacts.steps, contact.spots
    high = int(np.searchsorted(steps, begin / engine.step_seconds, side="right"))
    if not high or steps[high - 1] < before / engine.step_seconds - width:
        return np.zeros(motion.shape[2])
    last = slice(int(np.searchsorted(steps, steps[high - 1] - width)), high)
    points = contact.contacts[last]
    forces = points.pressures / (width + 1)
    radius = 1.0 / float(spots.curvatures[last].mean())
    modulus = 1.0 / float(spots.compliances[last].mean())
    mass = float(np.median(points.masses))
    damper = dashpot(np.array([forces.sum()]), radius, modulus, mass)
    side = contact.pair.index(number)
    along = motion_along(motion[spots.vertices[last, side]], points.own_forces[:, side])
    return np.asarray(0.5 * damper[0] * (forces @ along**2) / forces.sum())
