"""Forces of contacts, told apart: short ones are impacts, what lasts presses, rolls and slides.

A contact of the engine is softer than a real one, so the course of its force says little, but its
impulse is right.  Of the force between two solids what is gone within a few bounces' time (a
morphological opening tells) is one impact for each of its peaks, which is then heard as long as
Hertz says; the rest goes on as it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import grey_closing, grey_opening
from scipy.signal import find_peaks, peak_prominences

from sound.scenes.contact.contacts import ContactPoints
from sound.scenes.contact.touch import Spots, Touch
from sound.scenes.hertz import bounce_seconds
from sound.scenes.performance import Impact
from sound.scenes.scene import Scene

Array = NDArray[np.float64]
Integers = NDArray[np.integer]

LASTING = 2.5
"""Bounces' times that a force must last to be no impact."""
GAP_STEPS = 3
"""Steps without a force that do not end it: what lies still loses touch at times."""
PROMINENT = 0.5
"""Of the height of a peak: what it must stand out by to be an impact of its own."""
SLOWEST = 1e-3
"""Speed of approach [m/s] below which an impact is not heard; its force goes on as if it lasted."""
HOVERING = 0.5
"""Of the speed that gravity makes in a bounce's time: the engine cannot tell slower bounces from a
force that lasts."""
LONGEST = 0.02
"""Duration of an impact [s]; what is softer presses rather than strikes."""
_TINY = 1e-30


@dataclass(frozen=True)
class Blow:
    """An impact, and where on both solids it pushes.

    Attributes
    ----------
    impact
        What is told of it.
    places : (p, 2, 3) [m]
        Points at which it pushes, in each object's own axes, from its centre of mass.
    impulses : (p, 2, 3) [N s]
        By which it does, likewise.
    """

    impact: Impact
    places: Array
    impulses: Array


@dataclass(frozen=True)
class Pressing:
    """Contacts between two solids, of whose forces a part lasts.

    Attributes
    ----------
    pair : (2,)
        Numbers of the objects.
    contacts
        Points of contact in the order of time.
    spots
        What the surfaces are like there.
    shares : (c,)
        Of the force of each point, what lasts.
    """

    pair: tuple[int, int]
    contacts: ContactPoints
    spots: Spots
    shares: Array


def told_apart(
    contacts: ContactPoints, scene: Scene, touch: Touch
) -> tuple[list[Blow], list[Pressing]]:
    """Impacts in the order of time, and what lasts, pair by pair."""
    blows: list[Blow] = []
    pressings: list[Pressing] = []
    order = np.lexsort(contacts.pairs.T[::-1])  # stable: each pair's are in the order of time
    firsts = np.flatnonzero(np.diff(contacts.pairs[order], axis=0, prepend=-2).any(axis=1))
    for chosen in np.split(order, firsts[1:]):
        own = contacts[chosen]
        pair = (int(own.pairs[0, 0]), int(own.pairs[0, 1]))
        spots = touch.spots(pair, own)
        found, shares = _of_pair(pair, own, spots, scene)
        blows += found
        pressings.append(Pressing(pair, own, spots, shares))
    blows.sort(key=lambda blow: (blow.impact.seconds, blow.impact.pair))
    return blows, pressings


def _of_pair(
    pair: tuple[int, int], contacts: ContactPoints, spots: Spots, scene: Scene
) -> tuple[list[Blow], Array]:
    """Impacts of a pair, and shares (c,) of the forces that last."""
    first = int(contacts.steps[0])
    force = np.bincount(contacts.steps - first, contacts.pressures)
    width = round(LASTING * scene.engine.steps)
    # Zeros around: a force that begins or ends at the edge would last else.
    padded = grey_closing(np.pad(force, width), GAP_STEPS + 1)
    lasting = np.minimum(grey_opening(padded, width)[width:-width], force)
    share = np.divide(lasting, force, out=np.ones_like(force), where=force > 0.0)
    ranges = _peaks(force - lasting)
    if not len(ranges):
        return [], share[contacts.steps - first]
    lows, highs = np.searchsorted(contacts.steps, ranges.T + first)
    owners = np.repeat(np.arange(len(ranges)), highs - lows)
    chosen = np.arange(len(owners)) + np.repeat(lows - _starts(highs - lows), highs - lows)
    parts = contacts[chosen]
    weights = scene.engine.step_seconds * (1.0 - share[parts.steps - first])
    told = _impacts(pair, parts, Spots(*(each[chosen] for each in spots)), owners, weights, scene)
    for number in np.flatnonzero([each is None for each in told]):
        share[slice(*ranges[number])] = 1.0
    blows = _blows(told, parts, spots.vertices[chosen], owners, weights)
    return blows, share[contacts.steps - first]


def _starts(counts: Integers) -> Integers:
    """Where each of several groups begins, by how many each has."""
    return np.cumsum(counts) - counts


def _impacts(
    pair: tuple[int, int],
    contacts: ContactPoints,
    spots: Spots,
    owners: Integers,
    weights: Array,
    scene: Scene,
) -> list[Impact | None]:
    """The impacts of groups of contacts, by their `owners` (c,); None for what is too faint.

    Parameters
    ----------
    weights : (c,) [s]
        Impulse of each point over its force.
    """
    firsts = np.flatnonzero(np.diff(owners, prepend=-1))

    def summed(values: Array) -> Array:
        return np.asarray(np.add.reduceat(values, firsts, axis=0))

    pushes = weights * contacts.pressures
    totals = summed(pushes)
    safe = np.maximum(totals, _TINY)
    masses = safe / np.maximum(summed(pushes / contacts.masses), _TINY)
    closing = -np.einsum("ci,ci->c", contacts.velocities, contacts.normals)
    speeds = np.maximum.reduceat(closing, firsts)
    radii = safe / np.maximum(summed(pushes * spots.curvatures), _TINY)
    moduli = safe / np.maximum(summed(pushes * spots.giving), np.finfo(float).tiny)
    places = summed(pushes[:, None] * contacts.positions) / safe[:, None]
    impulses = summed(weights[:, None] * contacts.forces)
    seconds = contacts.steps[firsts] * scene.engine.step_seconds
    weight = float(np.linalg.norm(scene.gravity)) * scene.engine.contact_seconds
    slowest = max(SLOWEST, HOVERING * weight)
    found: list[Impact | None] = []
    for i in range(len(firsts)):
        if totals[i] <= 0.0 or speeds[i] < slowest:
            found.append(None)
            continue
        speed = float(speeds[i])
        duration = min(bounce_seconds(masses[i], radii[i], moduli[i], speed), LONGEST)
        time = float(seconds[i])
        found.append(Impact(time, pair, places[i], impulses[i], speed, duration))
    return found


def _blows(
    told: list[Impact | None],
    contacts: ContactPoints,
    vertices: Integers,
    owners: Integers,
    weights: Array,
) -> list[Blow]:
    """Blows of impacts; points that are nearest to the same vertices become one."""
    order = np.lexsort((vertices[:, 1], vertices[:, 0], owners))
    keys = np.column_stack([owners, vertices])[order]
    firsts = np.flatnonzero(np.any(np.diff(keys, axis=0, prepend=-2), axis=1))
    pushes = (weights * contacts.pressures)[order, None, None]
    totals = np.maximum(np.add.reduceat(pushes, firsts, axis=0), _TINY)
    places = np.add.reduceat(pushes * contacts.places[order], firsts, axis=0) / totals
    forces = weights[order, None, None] * contacts.own_forces[order]
    impulses = np.add.reduceat(forces, firsts, axis=0)
    ends = np.searchsorted(keys[firsts, 0], np.arange(len(told) + 1))
    return [
        Blow(impact, places[low:high], impulses[low:high])
        for impact, low, high in zip(told, ends[:-1], ends[1:])
        if impact is not None
    ]


def _peaks(force: Array) -> Integers:
    """Half-open ranges of steps (n, 2), one for every peak of a force (s,) that stands out."""
    padded = np.pad(force, 1)
    peaks = find_peaks(padded, height=0.0, plateau_size=1)[0]
    if not len(peaks):
        return np.zeros((0, 2), dtype=np.int64)
    stands_out = peak_prominences(padded, peaks)[0]
    return _cut(force, peaks[stands_out >= PROMINENT * padded[peaks]] - 1)


@numba.njit(cache=True)
def _cut(force, peaks):  # type: ignore[no-untyped-def]
    """Ranges (n, 2) about peaks (n,) of a force, cut where it is least between two."""
    ranges = np.empty((len(peaks), 2), dtype=np.int64)
    begin = 0
    for number in range(len(peaks)):
        end = len(force)
        if number + 1 < len(peaks):
            end = peaks[number] + 1
            for step in range(end + 1, peaks[number + 1]):
                if force[step] < force[end]:
                    end = step
        low, high = begin, end
        while not force[low] > 0.0:
            low += 1
        while not force[high - 1] > 0.0:
            high -= 1
        ranges[number] = low, high
        begin = end
    return ranges
