"""Start of a simulation: initial velocities, and separation of bodies that overlap.

The engine separates overlapping bodies within half a bounce, so a depth d of overlap becomes a
speed of pi d / T, where T is the duration of a bounce: a millimetre makes a bowl leap as high as
itself.  Depths are those of the convex parts, which may stand out of the visible surface.
"""

from __future__ import annotations

from collections.abc import Sequence
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from carillon.arrays import Array
from carillon.command_line.progress import say
from carillon.errors import UserError
from sound.scenes.body import Body
from sound.scenes.contact.impacts import SLOWEST
from sound.scenes.performance import GROUND
from sound.scenes.scene import Vector

OVERLAP = 0.01
"""Greatest depth of an overlap that is separated, over the longest side of the smaller body; a
deeper one is refused."""
STEEP = 0.3
"""Vertical component of the contact normal above which the upper of two bodies alone is moved;
below it each is moved by half of the depth."""
CLEAR = 0.01
"""Depth at which a separation ends, over the depth at which it begins."""
ROUNDS = 300
"""Greatest number of separations of all bodies: one that is moved may overlap another one."""
NAMED = 3
"""Greatest number of bodies that a message names."""


class Overlap(NamedTuple):
    """Two overlapping bodies.

    Attributes
    ----------
    pair : (2,)
        Numbers of the bodies; the ground, `GROUND`, is always the second one.
    depth : float [m]
        Distance by which the first body has to move to be clear.
    normal : (3,)
        Unit vector in which it has to move.
    """

    pair: tuple[int, int]
    depth: float
    normal: Array


def start(
    mujoco: ModuleType,
    model: Any,
    data: Any,
    bodies: Sequence[Body],
    gravity: Vector,
    contact_seconds: float,
) -> dict[int, Array]:
    """Set velocities, and separate bodies that overlap a little.

    Returns
    -------
    dict
        Displacements (3,) [m] of the bodies that were moved, by their numbers.

    Raises
    ------
    UserError
        If two bodies overlap by more than `OVERLAP`; the message names a position at which they
        would not.  Or if there is no room to separate bodies.
    """
    mujoco.mj_forward(model, data)
    _set_velocities(model, data, bodies)
    moved = _separated(mujoco, model, data, bodies, gravity, contact_seconds)
    mujoco.mj_forward(model, data)
    if moved:
        say(_in_words(moved, data, bodies))
    return moved


def _set_velocities(model: Any, data: Any, bodies: Sequence[Body]) -> None:
    """Set the velocities of all free bodies; spins are about the axes of the scene."""
    for number, body in enumerate(bodies):
        first = model.body_dofadr[number + 1]
        if first >= 0:
            turned = data.xmat[number + 1].reshape(3, 3)
            data.qvel[first : first + 3] = body.entry.velocity
            data.qvel[first + 3 : first + 6] = np.array(body.entry.spin) @ turned


def _separated(
    mujoco: ModuleType,
    model: Any,
    data: Any,
    bodies: Sequence[Body],
    gravity: Vector,
    contact_seconds: float,
) -> dict[int, Array]:
    """Displacements (3,) [m] of the bodies that had to be moved, by their numbers."""
    moved: dict[int, Array] = {}
    # Depth that is left: that of a body at rest under gravity, or of an impact that is not heard.
    bounce = contact_seconds / np.pi
    least = max(float(np.linalg.norm(gravity)) * bounce, SLOWEST) * bounce
    for _ in range(ROUNDS):
        overlaps = [each for each in _overlaps(model, data) if each.depth > least]
        if not overlaps:
            return moved
        if not moved:
            least *= CLEAR
            _require_shallow(mujoco, model, data, overlaps, bodies, least)
        for each in overlaps:
            for number, way in zip(each.pair, _ways(each, gravity, bodies)):
                if way.any():
                    moved[number] = moved.get(number, np.zeros(3)) + way
                    _move(model, data, number, way)
        mujoco.mj_forward(model, data)
    names = " and ".join(_name(number, bodies) for number in overlaps[0].pair)
    raise UserError(
        f"{names} overlap by {1e3 * overlaps[0].depth:.3g} mm at the start and are too closely "
        "packed to be moved apart; give them more room"
    )


def _overlaps(model: Any, data: Any) -> list[Overlap]:
    """The deepest overlap of each pair, in the order of their numbers."""
    owners = np.asarray(model.geom_bodyid, dtype=np.int64) - 1
    deepest: dict[tuple[int, int], Overlap] = {}
    contact = data.contact
    for depth, geoms, frame in zip(
        -np.asarray(contact.dist), np.asarray(contact.geom), np.asarray(contact.frame)
    ):
        one, other = (int(each) for each in owners[geoms])
        # The engine's normal points from the first to the second; here it points into the first.
        pair, normal = ((one, other), -frame[:3]) if one > other else ((other, one), frame[:3])
        if pair not in deepest or depth > deepest[pair].depth:
            deepest[pair] = Overlap(pair, float(depth), normal.copy())
    return [deepest[pair] for pair in sorted(deepest)]


def _require_shallow(
    mujoco: ModuleType,
    model: Any,
    data: Any,
    overlaps: Sequence[Overlap],
    bodies: Sequence[Body],
    least: float,
) -> None:
    """Refuse overlaps deeper than `OVERLAP`."""

    def excess(each: Overlap) -> float:
        sides = [_longest_side(bodies[number]) for number in each.pair if number != GROUND]
        return each.depth / (OVERLAP * min(sides))

    worst = max(overlaps, key=excess)
    if excess(worst) <= 1.0:
        return
    names = " and ".join(_name(number, bodies) for number in worst.pair)
    start = f"{names} overlap by {1e3 * worst.depth:.3g} mm at the start"
    first, second = worst.pair
    free = second if bodies[first].entry.fixed else first
    begin = data.xpos[free + 1].copy()
    place = _clear_place(mujoco, model, data, worst.pair, free, least)
    if place is None:
        raise UserError(f"{start}; move them apart")
    # Rounded away from the other body, so that the rounded position is clear, too.
    rounded = [_rounded(x, way) for x, way in zip(place, place - begin)]
    if second == GROUND:
        raise UserError(f"{start}; it rests on it at a height (z) of {rounded[2]} m")
    raise UserError(
        f"{start}; {_name(free, bodies)} would be clear at the position [{', '.join(rounded)}]"
    )


def _clear_place(
    mujoco: ModuleType, model: Any, data: Any, pair: tuple[int, int], free: int, least: float
) -> Array | None:
    """Position (3,) [m] at which body `free` of a pair, moved alone, is clear of the other one."""
    side = 1.0 if free == pair[0] else -1.0
    for _ in range(ROUNDS):
        overlap = next((each for each in _overlaps(model, data) if each.pair == pair), None)
        if overlap is None or overlap.depth <= least:
            return np.array(data.xpos[free + 1])
        _move(model, data, free, side * overlap.depth * overlap.normal)
        mujoco.mj_forward(model, data)
    return None


def _move(model: Any, data: Any, number: int, way: Array) -> None:
    first = model.jnt_qposadr[model.body_jntadr[number + 1]]
    data.qpos[first : first + 3] += way


def _ways(each: Overlap, gravity: Vector, bodies: Sequence[Body]) -> tuple[Array, Array]:
    """Displacements (3,) [m] of both bodies."""
    apart = each.depth * each.normal
    fixed = [number == GROUND or bodies[number].entry.fixed for number in each.pair]
    down = np.array(gravity)
    steepness = -float(each.normal @ down) / max(float(np.linalg.norm(down)), 1e-12)
    if fixed[1] or (steepness > STEEP and not fixed[0]):
        return apart, np.zeros(3)
    if fixed[0] or steepness < -STEEP:
        return np.zeros(3), -apart
    return 0.5 * apart, -0.5 * apart


def _longest_side(body: Body) -> float:
    return float(np.ptp(body.shape.vertices, axis=0).max())


def _name(number: int, bodies: Sequence[Body]) -> str:
    return "the ground" if number == GROUND else f"object {bodies[number].entry.name!r}"


def _rounded(value: float, direction: float) -> str:
    """A coordinate [m] rounded to a hundredth of a millimetre, up or down by the direction."""
    if abs(direction) < 1e-9:
        return f"{value:.5g}"
    hundredths = np.ceil(1e5 * value) if direction > 0.0 else np.floor(1e5 * value)
    return f"{hundredths / 1e5:.7g}"


def _in_words(moved: dict[int, Array], data: Any, bodies: Sequence[Body]) -> str:
    parts = []
    for number, way in sorted(moved.items())[:NAMED]:
        place = ", ".join(f"{x:.5g}" for x in data.xpos[number + 1])
        parts.append(
            f"{_name(number, bodies)} by {1e3 * float(np.linalg.norm(way)):.3g} mm to [{place}]"
        )
    rest = f" and {len(moved) - NAMED} more" if len(moved) > NAMED else ""
    return f"what overlaps at the start is moved apart: {', '.join(parts)}{rest}"
