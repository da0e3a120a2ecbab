"""Bodies that stand on something come to rest before time begins.

The convex parts that collide are up to a tenth of a millimetre off the surface, and a spring gives
way under the weight.  A body that is put down would tip and sink by as much, which is heard.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from sound.scenes.bodies import Body
from sound.scenes.packages import scene_package

KEPT = 0.9
"""Share of the velocities that a step keeps, so that bodies creep to where they rest."""
MOST_STEPS = 5_000
"""Greatest number of steps until all rest."""
AT_REST = 1e-6
"""Greatest speed [m/s] and rate of turning [1/s] of what rests."""
LITTLE = 0.01
"""Greatest way of a body that settles, over its longest side; one that goes further falls."""


def settle(data: Any, bodies: Sequence[Body], standing: Sequence[int]) -> None:
    """Let bodies of some numbers come to rest, while all others stay where they are.

    Positions alone are changed.  Those of a body that does not rest near to its place, such as one
    that topples or rolls, are not.
    """
    begin = np.array(data.qpos)
    left = list(standing)
    while left:
        rests = _settled(data, left)
        ways = np.linalg.norm(data.xpos - _places(data.model, begin), axis=1)
        far = [
            number
            for number in left
            if ways[number + 1] > LITTLE * np.ptp(bodies[number].shape.vertices, axis=0).max()
        ]
        if rests and not far:
            return
        data.qpos[:] = begin
        left = [number for number in left if number not in far] if far else []


def _settled(data: Any, standing: Sequence[int]) -> bool:
    """Move bodies to where they rest; whether they do."""
    mujoco = scene_package("mujoco")
    model = data.model
    trial = mujoco.MjData(model)
    begin = np.array(data.qpos)
    trial.qpos[:] = begin
    own, moving = np.zeros(model.nq, dtype=bool), np.zeros(model.nv, dtype=bool)
    for number in standing:
        joint, dof = model.body_jntadr[number + 1], model.body_dofadr[number + 1]
        if joint >= 0:
            first = model.jnt_qposadr[joint]
            own[first : first + 7] = True
            moving[dof : dof + 6] = True
    rests = False
    for _ in range(MOST_STEPS):
        mujoco.mj_step(model, trial)
        trial.qpos[~own] = begin[~own]
        trial.qvel[~moving] = 0.0
        rests = bool(np.abs(trial.qvel).max(initial=0.0) <= AT_REST)
        if rests:
            break
        trial.qvel *= KEPT
    data.qpos[:] = trial.qpos
    mujoco.mj_kinematics(model, data)
    return rests


def _places(model: Any, positions: Any) -> Any:
    mujoco = scene_package("mujoco")
    data = mujoco.MjData(model)
    data.qpos[:] = positions
    mujoco.mj_kinematics(model, data)
    return np.array(data.xpos)
