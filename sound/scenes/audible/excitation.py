"""What contacts do to the modes of a body: strikes, trembling forces, damping."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sound.rendering.solid import struck_amplitudes
from sound.scenes.audible.damping import moved_along, pushed_modes
from sound.scenes.audible.resting_contact import Rest
from sound.scenes.audible.ringing import BLOCK, Excitation
from sound.scenes.audible.sustained_contact import Pressed
from sound.scenes.bodies import Body
from sound.scenes.contact.impacts import Blow

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

MOST_DAMPED = 0.05
"""Of a mode's angular frequency: the most that what it lies on may add to its damping."""


def excitation(
    number: int,
    body: Body,
    motion: Array,
    blows: Sequence[Blow],
    pressings: Sequence[Pressed],
    rests: Sequence[Rest],
    count: int,
    rate: int,
    signed: bool,
    damped: bool,
) -> Excitation:
    """What acts on the modes of a body that sounds.

    Parameters
    ----------
    number
        Of the body.
    motion : (V, 3, K) [kg^-1/2]
        Of its surface's vertices in each mode.
    blows
        Those that it takes part in, in the order of time.
    pressings
        All of the scene.
    rests
        Times in which the body lies still.
    count, rate : int, int [Hz]
        Samples, and how many make a second.
    signed : bool
        Whether strikes push modes to where they do; else a mode sets out in the direction that it
        is pushed to, as `sound.rendering.solid.struck_amplitudes` has it.
    damped : bool
        Whether what the body touches damps it.
    """
    begins = rate * np.array([blow.impact.seconds for blow in blows])
    firsts = np.ceil(begins).astype(np.int64)
    touched = [pressing for pressing in pressings if number in pressing.pair]
    found = [_pushes(number, body, pressing, motion) for pressing in touched]
    modes = _modes(body)
    blocks = np.concatenate([np.zeros(0, np.int64), *(each.blocks for each in touched)])
    courses = np.concatenate([np.zeros((0, BLOCK)), *(each.courses for each in touched)])
    pushes = np.concatenate([np.zeros((0, modes)), *(pushed for pushed, _ in found)])
    order = np.argsort(blocks, kind="stable")
    own_dampings = [damping for _, damping in found] if damped else []
    last = -(-count // BLOCK)
    at, dampings = _dampings(
        touched, own_dampings, rests if damped else [], last, _most(body), rate
    )
    return Excitation(
        firsts,
        firsts - begins,
        np.array([blow.impact.duration for blow in blows]),
        _amplitudes(number, body, blows, signed),
        blocks[order],
        courses[order],
        pushes[order],
        at,
        dampings,
    )


def _amplitudes(number: int, body: Body, blows: Sequence[Blow], signed: bool) -> Array:
    """Amplitudes (S, K) [kg^-1/2 N s] of strikes; of a design as loud as its clips say."""
    if not blows:
        return np.zeros((0, _modes(body)))
    sides = [blow.impact.pair.index(number) for blow in blows]
    places = np.concatenate([blow.places[:, side] for blow, side in zip(blows, sides)])
    impulses = np.concatenate([blow.impulses[:, side] for blow, side in zip(blows, sides)])
    counts = [len(blow.places) for blow in blows]
    firsts = np.cumsum([0, *counts[:-1]])
    pushed = np.add.reduceat(pushed_modes(body, places, impulses), firsts, axis=0)
    if signed:
        return np.asarray(pushed)
    assert body.solid is not None
    found = struck_amplitudes(pushed, body.solid.frequencies)
    if body.listening is not None:
        middles = body.in_solid(middle_places(places, impulses, firsts))
        found *= np.array([[body.listening.gain(middle)] for middle in middles])
    return found


def middle_places(places: Array, impulses: Array, firsts: NDArray[np.integer]) -> Array:
    """Mean places (S, 3) [m] of groups of points that begin at `firsts`, weighted by impulses."""
    strengths = np.linalg.norm(impulses, axis=1)[:, None]
    totals = np.add.reduceat(strengths, firsts, axis=0)
    return np.asarray(np.add.reduceat(strengths * places, firsts, axis=0) / totals)


def _pushes(number: int, body: Body, pressing: Pressed, motion: Array) -> tuple[Array, Array]:
    """Pushes (b, K) of the forces of a pair, and dampings (b, K) [1/s].

    Parameters
    ----------
    motion : (V, 3, K) [kg^-1/2]
        Of the surface's vertices in each mode.
    """
    side = pressing.pair.index(number)
    vertices = pressing.vertices[:, side]
    forces = pressing.shares[:, None] * pressing.contacts.own_forces[:, side]
    sizes = np.linalg.norm(forces, axis=1, keepdims=True)
    along = moved_along(motion[vertices], forces)
    pushes = pressing.mean(sizes * along)
    if body.listening is not None:
        places = body.in_solid(body.shape.vertices[vertices[pressing.firsts]])
        pushes = pushes * np.array([[body.listening.gain(place)] for place in places])
    squares = pressing.mean(sizes * along**2) / pressing.mean(sizes)
    return pushes, 0.5 * pressing.dashpots[:, None] * squares


def _dampings(
    touched: Sequence[Pressed],
    own: Sequence[Array],
    rests: Sequence[Rest],
    blocks: int,
    most: Array,
    rate: int,
) -> tuple[Integers, Array]:
    """Blocks (d,) in which what a body touches damps it, and by how much (d, K) [1/s]."""
    dampings = np.zeros((blocks, len(most)))
    for pressing, damping in zip(touched, own):
        inside = pressing.blocks < blocks
        dampings[pressing.blocks[inside]] += damping[inside]
    for rest in rests:
        begin, end = np.clip(np.array([rest.begin, rest.end]) * rate / BLOCK, 0, blocks)
        dampings[int(begin) : int(end)] = rest.dampings
    at = np.flatnonzero(dampings.any(axis=1))
    return at, np.minimum(dampings[at], most)


def _most(body: Body) -> Array:
    assert body.solid is not None
    return MOST_DAMPED * 2.0 * np.pi * body.solid.frequencies


def _modes(body: Body) -> int:
    assert body.solid is not None
    return len(body.solid.frequencies)
