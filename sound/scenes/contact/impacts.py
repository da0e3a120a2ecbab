"""Contact forces split into impacts and sustained contact.

A contact of the engine is softer than a real one, so the course of its force says little, but its
impulse is right.  The part of the force between two bodies that lasts only a few bounces' time, by
a morphological opening, makes one impact for each of its peaks; Hertz's theory says how long that
impact sounds.  The rest of the force is sustained contact: resting, rolling and sliding.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import grey_closing, grey_opening
from scipy.signal import find_peaks, peak_prominences
from scipy.spatial import cKDTree

from carillon.arrays import Array, Integers
from carillon.composition.materials import NamedMaterial
from sound.scenes.bodies import Body
from sound.scenes.contact.contacts import ContactPoints
from sound.scenes.hertz import bounce_seconds, compliance
from sound.scenes.object_entry import Vector
from sound.scenes.performance import GROUND, Impact
from sound.scenes.scene import EngineEntry

LASTING = 2.5
"""Least duration of a sustained force, in durations of a bounce of the engine."""
GAP_STEPS = 3
"""Greatest number of steps without a force within one contact: resting bodies lose touch at
times."""
PROMINENT = 0.5
"""Least prominence of a peak of the force that is an impact of its own, over the peak's height."""
SLOWEST = 1e-3
"""Least speed of approach [m/s] of an audible impact; the force of a slower one counts as
sustained."""
HOVERING = 0.5
"""Least speed of approach of an impact, over the speed that a body gains by gravity in the duration
of a bounce: the engine cannot tell slower bounces from resting."""
LONGEST = 0.02
"""Greatest duration of an impact [s]; a softer one would be a push rather than a strike."""
_TINY = 1e-30


class Spots(NamedTuple):
    """Two surfaces at c points of contact.

    `vertices` (c, 2) are the nearest ones of each surface, `GROUND` for the ground; `curvatures`
    (c,) [1/m] are 1 / R, `compliances` (c,) [1/Pa] 1 / E of the effective radius and modulus, see
    `sound.scenes.hertz`; `roughness` (c,) [m] is that of both surfaces together.
    """

    vertices: NDArray[np.integer]
    curvatures: Array
    compliances: Array
    roughness: Array


class Touch:
    """The surfaces of all bodies and of the ground, which is flat, searched by position."""

    def __init__(self, bodies: list[Body], ground: NamedMaterial) -> None:
        self._bodies = bodies
        self._ground = float(compliance(ground.young, ground.poisson))
        self._rough_ground = ground.roughness
        shapes = {id(body.shape): body.shape for body in bodies}
        trees = {key: cKDTree(shape.vertices) for key, shape in shapes.items()}
        self._trees = [trees[id(body.shape)] for body in bodies]

    def spots(self, pair: tuple[int, int], contacts: ContactPoints) -> Spots:
        """The surfaces of a pair of bodies at their points of contact."""
        vertices = np.full((len(contacts), 2), GROUND)
        curvatures, compliances = np.zeros(len(contacts)), np.zeros(len(contacts))
        rough = np.zeros((2, len(contacts)))
        for side, number in enumerate(pair):
            if number == GROUND:
                compliances += self._ground
                rough[side] = self._rough_ground
                continue
            body = self._bodies[number]
            near = self._trees[number].query(contacts.places[:, side])[1]
            vertices[:, side] = near
            curvatures += 1.0 / body.shape.radii[near]
            compliances += body.compliance[near]
            rough[side] = np.array([each.roughness for each in body.materials])[body.which[near]]
        return Spots(vertices, curvatures, compliances, np.hypot(*rough))


@dataclass(frozen=True)
class HertzImpact:
    """An impact, with impulses (p, 2, 3) [N s] on the two bodies at the places (p, 2, 3) [m] where
    they touch, each in the body's own axes.
    """

    impact: Impact
    places: Array
    impulses: Array


@dataclass(frozen=True)
class SustainedContact:
    """All contacts of a pair of bodies in the order of time, the two surfaces at these points
    (`spots`), and the sustained `shares` (c,) of their forces.
    """

    pair: tuple[int, int]
    contacts: ContactPoints
    spots: Spots
    shares: Array


def split_impacts(
    contacts: ContactPoints, touch: Touch, engine: EngineEntry, gravity: Vector
) -> tuple[list[HertzImpact], list[SustainedContact]]:
    """Impacts in the order of time, and the sustained contact of each pair of bodies."""
    impacts: list[HertzImpact] = []
    sustained: list[SustainedContact] = []
    weight = float(np.linalg.norm(gravity)) * engine.contact_seconds
    slowest = max(SLOWEST, HOVERING * weight)
    order = np.lexsort(contacts.pairs.T[::-1])  # stable: each pair's are in the order of time
    firsts = np.flatnonzero(np.diff(contacts.pairs[order], axis=0, prepend=-2).any(axis=1))
    for chosen in np.split(order, firsts[1:]):
        own = contacts[chosen]
        pair = (int(own.pairs[0, 0]), int(own.pairs[0, 1]))
        spots = touch.spots(pair, own)
        of_pair, shares = _of_pair(pair, own, spots, engine, slowest)
        impacts += of_pair
        sustained.append(SustainedContact(pair, own, spots, shares))
    impacts.sort(key=lambda each: (each.impact.seconds, each.impact.pair))
    return impacts, sustained


def _of_pair(
    pair: tuple[int, int],
    contacts: ContactPoints,
    spots: Spots,
    engine: EngineEntry,
    slowest: float,
) -> tuple[list[HertzImpact], Array]:
    """Impacts of a pair, and sustained shares (c,) of the forces."""
    first = int(contacts.steps[0])
    force = np.bincount(contacts.steps - first, contacts.pressures)
    width = round(LASTING * engine.steps)
    # Zeros around: otherwise a force that begins or ends at the edge would count as sustained.
    padded = grey_closing(np.pad(force, width), GAP_STEPS + 1)
    lasting = np.minimum(grey_opening(padded, width)[width:-width], force)
    share = np.divide(lasting, force, out=np.ones_like(force), where=force > 0.0)
    ranges = _peaks(force - lasting)
    if not len(ranges):
        return [], share[contacts.steps - first]
    lows, highs = np.searchsorted(contacts.steps, ranges.T + first)
    owners = np.repeat(np.arange(len(ranges)), highs - lows)
    starts = np.cumsum(highs - lows) - (highs - lows)
    chosen = np.arange(len(owners)) + np.repeat(lows - starts, highs - lows)
    parts = contacts[chosen]
    weights = engine.step_seconds * (1.0 - share[parts.steps - first])
    struck = Spots(*(each[chosen] for each in spots))
    impacts = _impacts(pair, parts, struck, owners, weights, engine.step_seconds, slowest)
    for number in np.flatnonzero([each is None for each in impacts]):
        share[slice(*ranges[number])] = 1.0
    with_points = _with_points(impacts, parts, struck.vertices, owners, weights)
    return with_points, share[contacts.steps - first]


def _impacts(
    pair: tuple[int, int],
    contacts: ContactPoints,
    spots: Spots,
    owners: Integers,
    weights: Array,
    step_seconds: float,
    slowest: float,
) -> list[Impact | None]:
    """The impacts of groups of contacts; None for a group slower than `slowest` [m/s].

    `owners` (c,) are ascending numbers of each contact's group, `weights` (c,) [s] its impulse over
    its force.
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
    moduli = safe / np.maximum(summed(pushes * spots.compliances), np.finfo(float).tiny)
    places = summed(pushes[:, None] * contacts.positions) / safe[:, None]
    impulses = summed(weights[:, None] * contacts.forces)
    seconds = contacts.steps[firsts] * step_seconds
    impacts: list[Impact | None] = []
    for i in range(len(firsts)):
        if totals[i] <= 0.0 or speeds[i] < slowest:
            impacts.append(None)
            continue
        speed = float(speeds[i])
        duration = min(bounce_seconds(masses[i], radii[i], moduli[i], speed), LONGEST)
        time = float(seconds[i])
        impacts.append(Impact(time, pair, places[i], impulses[i], speed, duration))
    return impacts


def _with_points(
    impacts: list[Impact | None],
    contacts: ContactPoints,
    vertices: Integers,
    owners: Integers,
    weights: Array,
) -> list[HertzImpact]:
    """Impacts with their points; contacts nearest to the same two vertices become one point."""
    order = np.lexsort((vertices[:, 1], vertices[:, 0], owners))
    keys = np.column_stack([owners, vertices])[order]
    firsts = np.flatnonzero(np.any(np.diff(keys, axis=0, prepend=-2), axis=1))
    pushes = (weights * contacts.pressures)[order, None, None]
    totals = np.maximum(np.add.reduceat(pushes, firsts, axis=0), _TINY)
    places = np.add.reduceat(pushes * contacts.places[order], firsts, axis=0) / totals
    forces = weights[order, None, None] * contacts.own_forces[order]
    impulses = np.add.reduceat(forces, firsts, axis=0)
    ends = np.searchsorted(keys[firsts, 0], np.arange(len(impacts) + 1))
    return [
        HertzImpact(impact, places[low:high], impulses[low:high])
        for impact, low, high in zip(impacts, ends[:-1], ends[1:])
        if impact is not None
    ]


def _peaks(force: Array) -> Integers:
    """Half-open ranges of steps (n, 2), one for every prominent peak of a force (s,)."""
    padded = np.pad(force, 1)
    peaks = find_peaks(padded, height=0.0, plateau_size=1)[0]
    if not len(peaks):
        return np.zeros((0, 2), dtype=np.int64)
    prominences = peak_prominences(padded, peaks)[0]
    return _cut(force, peaks[prominences >= PROMINENT * padded[peaks]] - 1)


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
