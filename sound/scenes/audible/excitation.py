"""Excitation of a body's modes by contacts: impacts, sustained forces and added damping."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array
from sound.rendering.solid import struck_amplitudes
from sound.scenes.audible.contact_damping import Rest, greatest_damping, motion_along
from sound.scenes.audible.sustained_contact import SustainedForce
from sound.scenes.bodies import Body
from sound.scenes.contact.impacts import HertzImpact
from sound.synthesis.driven import BLOCK, Excitation

PLACES_AT_ONCE = 4096
"""Number of points whose motion in all modes is held in memory together."""


def excitation(
    number: int,
    body: Body,
    motion: Array,
    impacts: Sequence[HertzImpact],
    forces: Sequence[SustainedForce],
    rests: Sequence[Rest],
    count: int,
    rate: int,
    signed: bool,
    damped: bool,
) -> Excitation:
    """The excitation of the modes of a body that sounds.

    Parameters
    ----------
    motion : (V, 3, K) [kg^-1/2]
        Displacements of its surface's vertices in each mode.
    impacts, forces, rests
        Impacts that it takes part in, in the order of time; sustained forces of the whole scene;
        intervals in which the body is at rest.
    count, rate : int, int [Hz]
        Number of samples, and samples per second.
    signed, damped : bool
        Whether amplitudes keep their signs, else they are those of
        `sound.rendering.solid.struck_amplitudes`; whether contacts damp the modes.
    """
    assert body.solid is not None
    modes = len(body.solid.frequencies)
    begins = rate * np.array([each.impact.seconds for each in impacts])
    firsts = np.ceil(begins).astype(np.int64)
    own = [each for each in forces if number in each.pair]
    pushes_and_dampings = [_of_force(number, body, each, motion) for each in own]
    blocks = np.concatenate([np.zeros(0, np.int64), *(each.blocks for each in own)])
    courses = np.concatenate([np.zeros((0, BLOCK)), *(each.courses for each in own)])
    pushes = np.concatenate([np.zeros((0, modes)), *(each for each, _ in pushes_and_dampings)])
    order = np.argsort(blocks, kind="stable")
    added = np.zeros((-(-count // BLOCK) if damped else 0, modes))
    for force, (_, dampings) in zip(own, pushes_and_dampings):
        inside = force.blocks < len(added)
        added[force.blocks[inside]] += dampings[inside]
    for rest in rests:
        ends = np.array([rest.begin, rest.end]) * rate / BLOCK
        begin, end = np.clip(ends, 0, len(added))
        added[int(begin) : int(end)] = rest.dampings
    damped_blocks = np.flatnonzero(added.any(axis=1))
    return Excitation(
        firsts,
        firsts - begins,
        np.array([each.impact.duration for each in impacts]),
        _amplitudes(number, body, impacts, signed),
        blocks[order],
        courses[order],
        pushes[order],
        damped_blocks,
        np.minimum(added[damped_blocks], greatest_damping(body.solid.frequencies)),
    )


def _amplitudes(number: int, body: Body, impacts: Sequence[HertzImpact], signed: bool) -> Array:
    """Amplitudes (S, K) [kg^-1/2 N s] after impacts, times the gain of a design's clips."""
    assert body.solid is not None
    if not impacts:
        return np.zeros((0, len(body.solid.frequencies)))
    sides = [each.impact.pair.index(number) for each in impacts]
    places = np.concatenate([each.places[:, side] for each, side in zip(impacts, sides)])
    impulses = np.concatenate([each.impulses[:, side] for each, side in zip(impacts, sides)])
    firsts = np.cumsum([0, *(len(each.places) for each in impacts[:-1])])
    pushed = np.add.reduceat(_pushed_modes(body, places, impulses), firsts, axis=0)
    if signed:
        return np.asarray(pushed)
    amplitudes = struck_amplitudes(pushed, body.solid.frequencies)
    return amplitudes * body.gains(mean_places(places, impulses, firsts))


def _pushed_modes(body: Body, places: Array, impulses: Array) -> Array:
    """Products (p, K) [kg^-1/2 N s] of the modes with impulses (p, 3) at places (p, 3) [m]."""
    assert body.solid is not None
    pushed = np.empty((len(places), len(body.solid.frequencies)))
    for first in range(0, len(places), PLACES_AT_ONCE):
        part = slice(first, first + PLACES_AT_ONCE)
        pushed[part] = np.einsum("pik,pi->pk", body.motion(places[part]), impulses[part])
    return pushed


def mean_places(places: Array, impulses: Array, firsts: NDArray[np.integer]) -> Array:
    """Mean places (S, 3) [m] of groups of points that begin at `firsts`, weighted by impulses."""
    strengths = np.linalg.norm(impulses, axis=1)[:, None]
    totals = np.add.reduceat(strengths, firsts, axis=0)
    return np.asarray(np.add.reduceat(strengths * places, firsts, axis=0) / totals)


def _of_force(number: int, body: Body, force: SustainedForce, motion: Array) -> tuple[Array, Array]:
    """Products (b, K) of the modes with a sustained force, and its dampings (b, K) [1/s]."""
    side = force.pair.index(number)
    vertices = force.vertices[:, side]
    forces = force.shares[:, None] * force.contacts.own_forces[:, side]
    sizes = np.linalg.norm(forces, axis=1, keepdims=True)
    along = motion_along(motion[vertices], forces)
    gains = body.gains(body.shape.vertices[vertices[force.firsts]])
    squares = force.mean(sizes * along**2) / force.mean(sizes)
    return force.mean(sizes * along) * gains, 0.5 * force.dashpots[:, None] * squares
