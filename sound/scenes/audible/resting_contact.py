"""How what a body lies on damps it while it lies still, of which the engine tells nothing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sound.scenes.audible.damping import dashpot, moved_along
from sound.scenes.contact.impacts import LASTING, Pressing
from sound.scenes.scene import Scene

Array = NDArray[np.float64]


class Rest(NamedTuple):
    """A time in which a body lies still, from `begin` to `end` [s], and dampings (K,) [1/s]."""

    begin: float
    end: float
    dampings: Array


def rests_of(
    number: int,
    motion: Array,
    pressings: Sequence[Pressing],
    times: Array,
    resting: NDArray[np.bool_],
    scene: Scene,
) -> list[Rest]:
    """Times in which a body that sounds lies still, in their order.

    It then is pressed by the mean of the forces of the last moment before.

    Parameters
    ----------
    number
        Of the body.
    motion : (V, 3, K) [kg^-1/2]
        Of its surface's vertices in each mode.
    pressings
        All contacts of the scene, by pairs.
    times, resting : (T,) [s], (T,)
        Whether it lies still at each time.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], resting, [False]]).astype(int)))
    own = [each for each in pressings if number in each.pair]
    rests = []
    for first, after in edges.reshape(-1, 2):
        begin = float(times[first])
        end = float(times[after]) if after < len(times) else float("inf")
        before = float(times[max(0, first - 1)])
        parts = [_damping(number, motion, each, before, begin, scene) for each in own]
        rests.append(Rest(begin, end, np.sum(parts, axis=0)))
    return rests


def _damping(
    number: int,
    motion: Array,
    pressing: Pressing,
    before: float,
    begin: float,
    scene: Scene,
) -> Array:
    """Dampings (K,) [1/s] by one solid that the body touched in the last moment before a time."""
    step_seconds = scene.engine.step_seconds
    width = round(LASTING * scene.engine.steps)
    steps = pressing.contacts.steps
    high = int(np.searchsorted(steps, begin / step_seconds, side="right"))
    if not high or steps[high - 1] < before / step_seconds - width:
        return np.zeros(motion.shape[2])
    low = int(np.searchsorted(steps, steps[high - 1] - width))
    contacts = pressing.contacts[slice(low, high)]
    forces = contacts.pressures / (width + 1)
    radius = 1.0 / float(pressing.spots.curvatures[low:high].mean())
    modulus = 1.0 / float(pressing.spots.giving[low:high].mean())
    mass = float(np.median(contacts.masses))
    damper = dashpot(np.array([forces.sum()]), radius, modulus, mass)
    side = pressing.pair.index(number)
    moved = motion[pressing.spots.vertices[low:high, side]]
    along = moved_along(moved, contacts.own_forces[:, side])
    return np.asarray(0.5 * damper[0] * (forces @ along**2) / forces.sum())
