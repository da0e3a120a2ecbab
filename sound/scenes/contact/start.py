"""How bodies begin: as fast as their scene says, and none in another one.

The engine pushes what overlaps apart within half a bounce, so a depth d of overlap becomes a speed
of pi d / T, T being the time of a bounce: a millimetre lets a bowl leap as high as itself.  Depths
are those of the convex parts that touch, which may stand out of the surface that is seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from carillon.command_line.progress import say
from carillon.errors import UserError
from sound.scenes.bodies import Body
from sound.scenes.contact.impacts import SLOWEST
from sound.scenes.performance import GROUND
from sound.scenes.scene import Scene

Array = NDArray[np.float64]

OVERLAP = 0.01
"""Of the longest side of the smaller one: depth up to which two are moved apart before the start;
what is deeper is refused."""
STEEP = 0.3
"""Sine of the slope from which on a surface carries: of two bodies the upper one is moved then,
else each by half."""
CLEAR = 0.01
"""Of the depth from which bodies are moved apart: what is left once they are."""
ROUNDS = 300
"""Times that everything is moved apart at most: what is moved may get into another one."""
NAMED = 3
"""Bodies that a sentence names."""


class Overlap(NamedTuple):
    """Two solids that are in each other.

    Attributes
    ----------
    pair : (2,)
        Numbers of the objects; `GROUND` for the ground, which is the second one then.
    depth : float [m]
        How far the first one has to move to be clear.
    normal : (3,)
        In which direction, a unit vector.
    """

    pair: tuple[int, int]
    depth: float
    normal: Array


def start(
    mujoco: ModuleType, model: Any, data: Any, scene: Scene, bodies: Sequence[Body]
) -> dict[int, Array]:
    """Set velocities, and move bodies apart that overlap a little.

    Returns
    -------
    dict
        How far (3,) [m] bodies were moved, by their numbers.

    Raises
    ------
    UserError
        If two overlap by more than `OVERLAP`, with a position at which they would not, or have no
        room to be moved apart.
    """
    mujoco.mj_forward(model, data)
    _set_velocities(model, data, bodies)
    moved = _move_apart(mujoco, model, data, scene, bodies)
    mujoco.mj_forward(model, data)
    if moved:
        say(_in_words(moved, data, bodies))
    return moved


def _set_velocities(model: Any, data: Any, bodies: Sequence[Body]) -> None:
    """Those of rotation are given about the axes of the scene."""
    for number, body in enumerate(bodies):
        first = model.body_dofadr[number + 1]
        if first >= 0:
            turned = data.xmat[number + 1].reshape(3, 3)
            data.qvel[first : first + 3] = body.entry.velocity
            data.qvel[first + 3 : first + 6] = np.array(body.entry.spin) @ turned


def _move_apart(
    mujoco: ModuleType, model: Any, data: Any, scene: Scene, bodies: Sequence[Body]
) -> dict[int, Array]:
    moved: dict[int, Array] = {}
    least = _unheard_depth(scene)
    for _ in range(ROUNDS):
        found = [each for each in _overlaps(model, data) if each.depth > least]
        if not found:
            return moved
        if not moved:
            least *= CLEAR
            _require_shallow(mujoco, model, data, found, bodies, least)
        for each in found:
            for number, way in zip(each.pair, _ways(each, scene, bodies)):
                if way.any():
                    moved[number] = moved.get(number, np.zeros(3)) + way
                    _move(model, data, number, way)
        mujoco.mj_forward(model, data)
    names = " and ".join(_name(number, bodies) for number in found[0].pair)
    raise UserError(
        f"{names} overlap by {1e3 * found[0].depth:.3g} mm at the start and are too closely packed "
        "to be moved apart; give them more room"
    )


def _unheard_depth(scene: Scene) -> float:
    """Depth [m] that is left: what gravity presses a body in by, or too little to be heard."""
    bounce = scene.engine.contact_seconds / np.pi
    return max(float(np.linalg.norm(scene.gravity)) * bounce, SLOWEST) * bounce


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
    found: Sequence[Overlap],
    bodies: Sequence[Body],
    least: float,
) -> None:
    def excess(each: Overlap) -> float:
        sides = [_longest_side(bodies[number]) for number in each.pair if number != GROUND]
        return each.depth / (OVERLAP * min(sides))

    worst = max(found, key=excess)
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
    # Rounded away from the other one, so that the place can be written as it is told.
    rounded = [_rounded(x, way) for x, way in zip(place, place - begin)]
    if second == GROUND:
        raise UserError(f"{start}; it rests on it at a height (z) of {rounded[2]} m")
    raise UserError(
        f"{start}; {_name(free, bodies)} would be clear at the position [{', '.join(rounded)}]"
    )


def _clear_place(
    mujoco: ModuleType, model: Any, data: Any, pair: tuple[int, int], free: int, least: float
) -> Array | None:
    """Where (3,) [m] one of a pair, moved alone, is clear of the other one."""
    side = 1.0 if free == pair[0] else -1.0
    for _ in range(ROUNDS):
        found = [each for each in _overlaps(model, data) if each.pair == pair]
        if not found or found[0].depth <= least:
            return np.array(data.xpos[free + 1])
        _move(model, data, free, side * found[0].depth * found[0].normal)
        mujoco.mj_forward(model, data)
    return None


def _move(model: Any, data: Any, number: int, way: Array) -> None:
    first = model.jnt_qposadr[model.body_jntadr[number + 1]]
    data.qpos[first : first + 3] += way


def _ways(each: Overlap, scene: Scene, bodies: Sequence[Body]) -> tuple[Array, Array]:
    """How far (3,) [m] either is moved."""
    apart = each.depth * each.normal
    fixed = [number == GROUND or bodies[number].entry.fixed for number in each.pair]
    down = np.array(scene.gravity)
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
    """A coordinate [m] to a hundredth of a millimetre, rounded in a direction if there is one."""
    if abs(direction) < 1e-9:
        return f"{value:.5g}"
    hundredths = np.ceil(1e5 * value) if direction > 0.0 else np.floor(1e5 * value)
    return f"{hundredths / 1e5:.7g}"


def _in_words(moved: dict[int, Array], data: Any, bodies: Sequence[Body]) -> str:
    told = []
    for number, way in sorted(moved.items())[:NAMED]:
        place = ", ".join(f"{x:.5g}" for x in data.xpos[number + 1])
        told.append(
            f"{_name(number, bodies)} by {1e3 * float(np.linalg.norm(way)):.3g} mm to [{place}]"
        )
    rest = f" and {len(moved) - NAMED} more" if len(moved) > NAMED else ""
    return f"what overlaps at the start is moved apart: {', '.join(told)}{rest}"
