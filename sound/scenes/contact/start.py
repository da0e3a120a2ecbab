"""Start of a simulation: initial velocities, and separation of bodies that overlap.

The engine separates overlapping bodies within half a bounce, so a depth d of overlap becomes a
speed of pi d / T, where T is the duration of a bounce: a millimetre makes a bowl leap as high as
itself.  Depths are those of the convex parts, which may stand out of the visible surface.
"""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from carillon.arrays import Array
from carillon.command_line.progress import say
from carillon.errors import UserError
from carillon.fem.geometry.size import length_in_words
from sound.scenes.bodies import Body
from sound.scenes.contact.impacts import SLOWEST
from sound.scenes.object_entry import Vector
from sound.scenes.packages import scene_package
from sound.scenes.performance import GROUND

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
    """A pair of overlapping bodies, by numbers; the ground, `GROUND`, is always the second one.

    The first has to move by `depth` [m] along the unit vector `normal` (3,) to be clear.
    """

    pair: tuple[int, int]
    depth: float
    normal: Array


def start(
    data: Any, bodies: Sequence[Body], gravity: Vector, contact_seconds: float
) -> dict[int, Array]:
    """Set velocities, and separate bodies that overlap a little; displacements (3,) [m] by their
    numbers.

    Raises UserError if two bodies overlap by more than `OVERLAP`, with a position at which they
    would not, or if there is no room to separate bodies.
    """
    _forward(data)
    _set_velocities(data, bodies)
    moved: dict[int, Array] = {}
    from_others: dict[int, dict[int, None]] = {}
    for number, other, way in _separated(data, bodies, gravity, contact_seconds):
        moved[number] = moved.get(number, np.zeros(3)) + way
        from_others.setdefault(number, {})[other] = None
    _forward(data)
    if moved:
        say(_in_words(moved, from_others, data, bodies))
    return moved


def _forward(data: Any) -> None:
    """Bring contacts and poses to the positions."""
    scene_package("mujoco").mj_forward(data.model, data)


def _set_velocities(data: Any, bodies: Sequence[Body]) -> None:
    for number, body in enumerate(bodies):
        first = data.model.body_dofadr[number + 1]
        if first >= 0:
            turned = data.xmat[number + 1].reshape(3, 3)
            data.qvel[first : first + 3] = body.entry.velocity
            data.qvel[first + 3 : first + 6] = np.array(body.entry.spin) @ turned


def _separated(
    data: Any, bodies: Sequence[Body], gravity: Vector, contact_seconds: float
) -> Iterator[tuple[int, int, Array]]:
    """Separate bodies: the number of each that is moved, that of the one it is moved from, and its
    way (3,) [m]."""
    first = True
    # Depth that is left: that of a body at rest under gravity, or of an impact that is not heard.
    bounce = contact_seconds / np.pi
    least = max(float(np.linalg.norm(gravity)) * bounce, SLOWEST) * bounce
    for _ in range(ROUNDS):
        overlaps = [each for each in _overlaps(data) if each.depth > least]
        if not overlaps:
            return
        if first:
            first = False
            least *= CLEAR
            _require_shallow(data, overlaps, bodies, least)
        for each in overlaps:
            others = reversed(each.pair)
            for number, other, way in zip(each.pair, others, _ways(each, gravity, bodies)):
                if way.any():
                    _move(data, number, way)
                    yield number, other, way
        _forward(data)
    names = " and ".join(_name(number, bodies) for number in overlaps[0].pair)
    raise UserError(
        f"{names} overlap by {length_in_words(overlaps[0].depth)} at the start and are too "
        "closely packed to be moved apart; give them more room"
    )


def _overlaps(data: Any) -> list[Overlap]:
    """The deepest overlap of each pair, in the order of their numbers."""
    owners = np.asarray(data.model.geom_bodyid, dtype=np.int64) - 1
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
    data: Any, overlaps: Sequence[Overlap], bodies: Sequence[Body], least: float
) -> None:
    def excess(each: Overlap) -> float:
        shapes = [bodies[number].shape.vertices for number in each.pair if number != GROUND]
        return each.depth / (OVERLAP * min(float(np.ptp(x, axis=0).max()) for x in shapes))

    worst = max(overlaps, key=excess)
    if excess(worst) <= 1.0:
        return
    names = " and ".join(_name(number, bodies) for number in worst.pair)
    start = f"{names} overlap by {length_in_words(worst.depth)} at the start"
    first, second = worst.pair
    free = second if bodies[first].entry.fixed else first
    begin = data.xpos[free + 1].copy()
    place = _clear_place(data, worst.pair, free, least)
    if place is None:
        raise UserError(f"{start}; move them apart")
    # Rounded away from the other body, so that the rounded position is clear, too.
    rounded = [_rounded(x, way) for x, way in zip(place, place - begin)]
    if second == GROUND:
        raise UserError(
            f"{start}; it rests on it with stands_on: ground, or at a height (z) of {rounded[2]} m"
        )
    raise UserError(
        f"{start}; {_name(free, bodies)} would be clear at the position [{', '.join(rounded)}]"
    )


def _clear_place(data: Any, pair: tuple[int, int], free: int, least: float) -> Array | None:
    """Position (3,) [m] at which body `free` of a pair, moved alone, is clear of the other one."""
    side = 1.0 if free == pair[0] else -1.0
    for _ in range(ROUNDS):
        overlap = next((each for each in _overlaps(data) if each.pair == pair), None)
        if overlap is None or overlap.depth <= least:
            return np.array(data.xpos[free + 1])
        _move(data, free, side * overlap.depth * overlap.normal)
        _forward(data)
    return None


def _move(data: Any, number: int, way: Array) -> None:
    model = data.model
    first = model.jnt_qposadr[model.body_jntadr[number + 1]]
    data.qpos[first : first + 3] += way


def _ways(each: Overlap, gravity: Vector, bodies: Sequence[Body]) -> tuple[Array, Array]:
    apart = each.depth * each.normal
    fixed = [number == GROUND or bodies[number].entry.fixed for number in each.pair]
    down = np.array(gravity)
    steepness = -float(each.normal @ down) / max(float(np.linalg.norm(down)), 1e-12)
    if fixed[1] or (steepness > STEEP and not fixed[0]):
        return apart, np.zeros(3)
    if fixed[0] or steepness < -STEEP:
        return np.zeros(3), -apart
    return 0.5 * apart, -0.5 * apart


def _name(number: int, bodies: Sequence[Body]) -> str:
    return "the ground" if number == GROUND else f"object {bodies[number].entry.name!r}"


def _rounded(value: float, direction: float) -> str:
    """A coordinate [m] rounded to a hundredth of a millimetre, up or down by the direction."""
    if abs(direction) < 1e-9:
        return f"{value:.5g}"
    hundredths = np.ceil(1e5 * value) if direction > 0.0 else np.floor(1e5 * value)
    return f"{hundredths / 1e5:.7g}"


def _in_words(
    moved: dict[int, Array],
    from_others: dict[int, dict[int, None]],
    data: Any,
    bodies: Sequence[Body],
) -> str:
    parts = []
    for number, way in sorted(moved.items())[:NAMED]:
        place = ", ".join(f"{x:.5g}" for x in data.xpos[number + 1])
        others = " and ".join(_name(other, bodies) for other in from_others[number])
        parts.append(
            f"{_name(number, bodies)} from {others} by "
            f"{length_in_words(float(np.linalg.norm(way)))} to [{place}]"
        )
    rest = f", and {len(moved) - NAMED} more" if len(moved) > NAMED else ""
    return f"what overlaps at the start is moved apart: {', '.join(parts)}{rest}"
