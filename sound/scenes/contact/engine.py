"""Rigid bodies under gravity, by MuJoCo: how they move, and the forces where they touch."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon.command_line.logs import warn_once
from carillon.command_line.progress import track
from carillon.errors import UserError, one_line
from sound.scenes.bodies import Body
from sound.scenes.contact.bounce import damping_ratio
from sound.scenes.contact.contact_log import ContactLog
from sound.scenes.contact.contacts import ContactPoints
from sound.scenes.contact.start import start
from sound.scenes.materials import NamedMaterial
from sound.scenes.packages import scene_package
from sound.scenes.picture import Motion
from sound.scenes.scene import Scene

Array = NDArray[np.float64]

PICTURES_PER_SECOND = 120
"""Poses that are kept."""
FASTEST = 1e4
"""Speed [m/s] beyond which a scene has burst."""
STEPS_TO_SLEEP = 10
"""The engine's own number (mjMINAWAKE)."""
SLOWEST_BODY = 1e-7
"""Speed [m/s] at which a body lies still where nothing falls."""
MOST_CONTACTS, MOST_CONTACTS_EACH = 1_000_000, 20_000
"""Points of contact, each counted in every step, that a scene may have for every second; and for
every object and second, where that is more."""
MOST_KEPT = 12_000_000
"""Points of contact that a scene may have in all, which take 3 GB."""
_IMPEDANCE = [0.999, 0.999, 0.001, 0.5, 2.0]


@dataclass(frozen=True)
class Course:
    """How a scene goes.

    Attributes
    ----------
    motion
        Poses of all objects.
    contacts
        What touched what, in the order of time.
    resting : (T, B)
        Whether each object lay still, at the times of the motion.
    moved : dict
        How far (3,) [m] objects were moved before the start to be apart, by their numbers.
    """

    motion: Motion
    contacts: ContactPoints
    resting: NDArray[np.bool_]
    moved: dict[int, Array]


def simulate(scene: Scene, bodies: list[Body], visible: bool = True) -> Course:
    """Let bodies move as a scene says.

    Bodies that overlap a little at the start are moved apart, see `sound.scenes.contact.start`.
    Contacts are springs with dampers: a bounce takes `engine.contact_seconds` whatever the mass,
    and leaves the share of speed that the restitution says.  Bodies that lie still sleep.

    Raises
    ------
    UserError
        If two bodies overlap much at the start, if anything flies apart, or touches too often.
    """
    mujoco = loaded()
    model = _model(mujoco, scene, bodies)
    data = mujoco.MjData(model)
    moved = start(mujoco, model, data, scene, bodies)
    recorder = _Recorder(model, data, bodies)
    every = max(1, round(1.0 / (PICTURES_PER_SECOND * scene.engine.step_seconds)))
    poses = int(np.ceil(scene.seconds / (every * scene.engine.step_seconds)))
    steps = every * poses
    for step in track(
        range(steps), "moving", unit="steps", visible=visible and sys.stderr.isatty()
    ):
        if step % every == 0:
            recorder.take_pose()
        before = data.qvel.copy()
        mujoco.mj_step(model, data)
        if data.ncon:
            recorder.take_contacts(step, before)
            recorder.require_few((step + 1) * scene.engine.step_seconds)
        if step % every == 0:
            recorder.require_calm(step * scene.engine.step_seconds)
    return recorder.course(every * scene.engine.step_seconds, moved)


def loaded() -> Any:
    """MuJoCo, whose warnings are logged; it would add them to a file in the present folder."""
    mujoco = scene_package("mujoco")
    mujoco.set_mju_user_warning(lambda text: warn_once(one_line(f"MuJoCo says: {text}")))
    return mujoco


def _model(mujoco: ModuleType, scene: Scene, bodies: list[Body]) -> Any:
    """The engine's description of a scene."""
    spec = mujoco.MjSpec()
    spec.option.timestep = scene.engine.step_seconds
    spec.option.gravity = scene.gravity
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.enableflags |= mujoco.mjtEnableBit.mjENBL_SLEEP
    spec.option.sleep_tolerance = _stillness(scene)
    if scene.ground is not None:
        _add_ground(mujoco, spec, scene)
    for number, body in enumerate(bodies):
        _add_body(mujoco, spec, scene, number, body)
    return spec.compile()


def _stillness(scene: Scene) -> float:
    """Speed [m/s] below which a body that keeps it for `STEPS_TO_SLEEP` lies still.

    A quarter of what a body gains in them that falls: none is still at the top of its flight.
    """
    gained = float(np.linalg.norm(scene.gravity)) * STEPS_TO_SLEEP * scene.engine.step_seconds
    return max(0.25 * gained, SLOWEST_BODY)


def _add_ground(mujoco: ModuleType, spec: Any, scene: Scene) -> None:
    material: NamedMaterial = scene.ground_material
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[0.0, 0.0, 1.0],
        pos=[0.0, 0.0, scene.ground],
        **_touch(scene, material.friction, material.restitution),
    )


def _add_body(mujoco: ModuleType, spec: Any, scene: Scene, number: int, body: Body) -> None:
    from scipy.spatial.transform import Rotation

    entry = body.entry
    x, y, z, w = Rotation.from_euler("xyz", entry.rotation, degrees=True).as_quat()
    inertia = body.inertia
    added = spec.worldbody.add_body(
        name=str(number),
        pos=entry.position,
        quat=[w, x, y, z],
        explicitinertial=True,
        mass=body.mass,
        ipos=[0.0, 0.0, 0.0],
        fullinertia=[*np.diag(inertia), inertia[0, 1], inertia[0, 2], inertia[1, 2]],
    )
    if not entry.fixed:
        added.add_freejoint()
    touch = _touch(scene, entry.friction, entry.restitution)
    if entry.radius is not None:
        size = [entry.radius, 0.0, 0.0]
        added.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=size, **touch)
    for part, corners in enumerate(body.parts):
        name = f"{number} {part}"
        spec.add_mesh(name=name, uservert=corners.ravel().tolist())
        added.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, **touch)


def _touch(scene: Scene, friction: float, restitution: float) -> dict[str, Any]:
    """What the engine knows of a surface."""
    stiff = (np.pi / scene.engine.contact_seconds) ** 2
    ratio = damping_ratio(restitution, scene.engine.steps)
    return {
        "friction": [friction, 0.0, 0.0],
        "solref": [-stiff, -2.0 * ratio * np.sqrt(stiff)],
        "solimp": _IMPEDANCE,
        "condim": 3,
    }


class _Recorder:
    """Keeps what the engine tells."""

    def __init__(self, model: Any, data: Any, bodies: list[Body]) -> None:
        self.model, self.data, self.bodies = model, data, bodies
        self.owners = np.asarray(model.geom_bodyid, dtype=np.int64) - 1
        self.first_speed = np.asarray(model.body_dofadr[1:], dtype=np.int64)
        self.free = self.first_speed >= 0
        self.inverse_mass = np.array([0.0 if b.entry.fixed else 1.0 / b.mass for b in bodies])
        self.inverse_inertia = np.array(
            [np.zeros((3, 3)) if b.entry.fixed else np.linalg.inv(b.inertia) for b in bodies]
        )
        self.log = ContactLog()
        self.positions: list[Array] = []
        self.rotations: list[Array] = []
        self.resting: list[NDArray[np.bool_]] = []

    def take_pose(self) -> None:
        self.positions.append(self.data.xpos[1:].copy())
        self.rotations.append(self.data.xquat[1:].copy())
        self.resting.append(np.asarray(self.data.body_awake[1:] != 1) & self.free)

    def take_contacts(self, step: int, velocities: Array) -> None:
        """Keep what touches in a step, at whose beginning there were these velocities."""
        contact, data = self.data.contact, self.data
        self.log.take(
            step,
            contact.efc_address,
            contact.geom,
            contact.pos,
            contact.frame,
            data.efc_force,
            data.xpos,
            data.xmat,
            velocities,
            self.owners,
            self.first_speed,
            self.inverse_mass,
            self.inverse_inertia,
        )

    def require_few(self, seconds: float) -> None:
        """Refuse more contacts than can be kept."""
        rate = max(MOST_CONTACTS, MOST_CONTACTS_EACH * len(self.bodies))
        if self.log.count > min(rate * max(1.0, seconds), MOST_KEPT):
            raise UserError(
                f"found {self.log.count:,} contacts in the first {seconds:.3g} s (counted in every "
                f"step), expected at most {rate:,} a second and {MOST_KEPT:,} in all; take fewer "
                "objects, hull in place of parts, or fewer steps of the engine"
            )

    def require_calm(self, seconds: float) -> None:
        """Refuse a scene that has burst."""
        speed = float(np.abs(self.data.qvel).max(initial=0.0))
        if not speed < FASTEST:
            raise UserError(
                f"after {seconds:.3g} s something moves at {speed:.3g} m/s or turns at as many "
                "rad/s; look at positions and masses, or give the engine more steps"
            )

    def course(self, seconds: float, moved: dict[int, Array]) -> Course:
        self.take_pose()
        times = seconds * np.arange(len(self.positions))
        motion = Motion(times, np.array(self.positions), np.array(self.rotations))
        return Course(motion, self.log.contacts(), np.array(self.resting), moved)
