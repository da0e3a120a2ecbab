"""Damping of a body's modes by the bodies that it touches.

A contact is a spring with a dashpot.  A dashpot c along the unit vector u takes the power
c (u . v)^2 from a body that moves at the velocity v there, which adds c (u . U_k)^2 / 2 to the
damping of a mode U_k.

The engine records no contacts of a sleeping body, so the contacts of the last moment before are
taken for it.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array
from sound.scenes.contact.impacts import LASTING, SustainedContact
from sound.scenes.hertz import stiffness
from sound.scenes.scene import EngineEntry

DAMPING_RATIO = 0.1
"""Damping ratio of a contact: an assumption that stands for all losses there."""
MOST_DAMPED = 0.05
"""Greatest damping that contacts add to a mode, over the mode's angular frequency."""
_TINY = 1e-12


def dashpot(forces: Array, radius: float, modulus: float, mass: float) -> Array:
    """Dashpots [N s/m] of contacts under forces [N], by the effective radius [m], modulus [Pa] and
    mass [kg], see `sound.scenes.hertz`.
    """
    springs = stiffness(forces, radius, modulus)
    return np.asarray(2.0 * DAMPING_RATIO * np.sqrt(springs * mass))


def motion_along(motion: Array, forces: Array) -> Array:
    """Components (p, K) along forces (p, 3) of the motion (p, 3, K) of points in each mode."""
    sizes = np.linalg.norm(forces, axis=1, keepdims=True)
    return np.asarray(np.einsum("pik,pi->pk", motion, forces / np.maximum(sizes, _TINY)))


def greatest_damping(frequencies: Array) -> Array:
    """Greatest damping (K,) [1/s] that contacts add to modes at frequencies (K,) [Hz]."""
    return MOST_DAMPED * 2.0 * np.pi * frequencies


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

    `motion` (V, 3, K) [kg^-1/2] are displacements of its surface's vertices in each mode,
    `contacts` all of the scene, by pairs; `resting` (T,) tells whether the body is at rest at the
    times (T,) [s].
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
