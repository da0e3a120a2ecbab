"""Heights of objects that stand on the ground or on other objects at the start."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from carillon.arrays import Array, Index
from carillon.errors import UserError
from sound.scenes.bodies import Body
from sound.scenes.packages import scene_package
from sound.scenes.scene import GROUND_NAME

NEAR = 1e-7
"""Distance [m] at which one object stands on another."""
ROUNDS = 1000
"""Greatest number of steps downwards; each is as long as the distance that is left."""


def stood(model: Any, bodies: Sequence[Body], ground: float | None) -> list[Body]:
    """The bodies, those that stand on something at the least height at which they are clear of it.

    `model` is MuJoCo's of the bodies, `ground` the height of the floor [m].  A body comes down
    from above, at its x and y and turned as it is; what else is in its way does not count.  Raises
    UserError if it does not meet what it is to stand on.
    """
    mujoco = scene_package("mujoco")
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    numbers = {body.entry.name: number for number, body in enumerate(bodies)}
    heights = np.array([body.entry.position[2] for body in bodies])
    for number in _from_below(bodies, numbers):
        support = bodies[number].entry.stands_on
        if support == GROUND_NAME:
            assert ground is not None
            way = ground - _heights(data, bodies, number)[0]
        else:
            assert support is not None
            way = _way_down(data, bodies, number, numbers[support])
        data.geom_xpos[_geoms(model, number), 2] += way
        data.xpos[number + 1, 2] += way
        heights[number] += way
    return [
        replace(body, entry=replace(body.entry, stands_on=None, position=_at(body, height)))
        for body, height in zip(bodies, heights)
    ]


def _at(body: Body, height: float) -> tuple[float, float, float]:
    x, y, _ = body.entry.position
    return x, y, float(height)


def _from_below(bodies: Sequence[Body], numbers: dict[str, int]) -> Iterator[int]:
    """Numbers of the bodies that stand on something, each after what it stands on."""
    left = [number for number, body in enumerate(bodies) if body.entry.stands_on is not None]
    while left:
        for number in left:
            if numbers.get(bodies[number].entry.stands_on or "") not in left:
                yield number
                left.remove(number)
                break


def _geoms(model: Any, number: int) -> Index:
    return np.flatnonzero(np.asarray(model.geom_bodyid) == number + 1)


def _heights(data: Any, bodies: Sequence[Body], number: int) -> tuple[float, float]:
    """Heights [m] of a body's lowest and highest points."""
    body, middle = bodies[number], float(data.xpos[number + 1, 2])
    if body.radius is not None:
        return middle - body.radius, middle + body.radius
    along: Array = np.concatenate(body.parts) @ data.xmat[number + 1].reshape(3, 3)[2]
    return middle + float(along.min()), middle + float(along.max())


def _way_down(data: Any, bodies: Sequence[Body], number: int, support: int) -> float:
    """Way [m] along z on which a body comes to stand on another one."""
    mujoco = scene_package("mujoco")
    model, own, others = data.model, _geoms(data.model, number), _geoms(data.model, support)
    low, high = _heights(data, bodies, number)
    bottom, top = _heights(data, bodies, support)
    gap = max(1e-3 * (high - low), NEAR)
    begin = np.array(data.geom_xpos[own, 2])
    way = top + gap - low
    for _ in range(ROUNDS):
        data.geom_xpos[own, 2] = begin + way
        away = high + way - bottom
        for one in own:
            for other in others:
                away = mujoco.mj_geomDistance(model, data, one, other, max(away, NEAR), None)
        if away <= NEAR:
            data.geom_xpos[own, 2] = begin
            return float(way)
        way -= away
        if high + way < bottom:
            break
    name, below = (repr(bodies[each].entry.name) for each in (number, support))
    x, y, _ = bodies[number].entry.position
    raise UserError(
        f"object {name} at x = {x:g} m, y = {y:g} m does not meet object {below}, on which it is "
        "to stand; move it over that"
    )
