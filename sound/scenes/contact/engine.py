"""Motion of rigid bodies under gravity by MuJoCo, and the forces at their contacts."""

from dataclasses import dataclass
from functools import cache
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from carillon.arrays import Array
from carillon.command_line.logs import warn_once
from carillon.command_line.progress import track
from carillon.composition.materials import NamedMaterial
from carillon.errors import UserError, one_line
from sound.scenes.bodies import Body
from sound.scenes.contact.contacts import ContactLog, ContactPoints
from sound.scenes.contact.settling import settle
from sound.scenes.contact.standing import stood
from sound.scenes.contact.start import start
from sound.scenes.cylinder import Cylinder
from sound.scenes.object_entry import ObjectEntry, Vector
from sound.scenes.packages import scene_package
from sound.scenes.performance import Motion
from sound.scenes.scene import EngineEntry

PICTURES_PER_SECOND = 120
"""Number of poses of each body that are kept for every second."""
FASTEST = 1e4
"""Greatest speed [m/s] of any body; a greater one means that the simulation is unstable."""
STEPS_TO_SLEEP = 10
"""Number of steps that a body must be slow for before MuJoCo lets it sleep (mjMINAWAKE)."""
SLOWEST_BODY = 1e-7
"""Speed [m/s] below which a body sleeps in a scene without gravity."""
MOST_CONTACTS, MOST_CONTACTS_EACH = 1_000_000, 20_000
"""Greatest number of contact points in a second, for the whole scene and for each object; the
larger limit holds.  A point that lasts counts in every step."""
MOST_KEPT = 12_000_000
"""Greatest number of contact points in a whole scene; they take 3 GB."""
_IMPEDANCE = [0.999, 0.999, 0.001, 0.5, 2.0]
"""MuJoCo's `solimp` of every contact: a constraint that hardly yields beyond its spring."""
PHASES = 16
"""Number of moments within a step at which a bounce may begin; their bounces are averaged."""
MOST_DAMPED = 1.5
"""Greatest damping ratio that the engine's steps resolve."""


class GroundPlane(NamedTuple):
    """The ground at a `height` [m], or no ground if that is None, and its material."""

    height: float | None
    material: NamedMaterial


@dataclass(frozen=True)
class Course:
    """The motion of all bodies, and their points of contact in the order of time.

    `resting` (T, B) tells whether each body slept, at the times of the motion; `moved` the
    displacements (3,) [m] by which overlapping bodies were separated before the start, by the
    numbers of the bodies.
    """

    motion: Motion
    contacts: ContactPoints
    resting: NDArray[np.bool_]
    moved: dict[int, Array]


def simulate(
    bodies: list[Body],
    seconds: float,
    engine: EngineEntry,
    gravity: Vector,
    ground: GroundPlane,
    visible: bool = True,
) -> Course:
    """Simulate the motion of bodies for some seconds under gravity (3,) [m/s^2].

    Those that stand on something are put there and settle, see `sound.scenes.contact.standing` and
    `sound.scenes.contact.settling`; those that overlap a little at the start are separated, see
    `sound.scenes.contact.start`.
    Contacts are springs with dampers: a bounce takes `engine.contact_seconds` whatever the masses,
    and leaves the share of speed that the restitution says.  Bodies that lie still sleep.  Raises
    UserError if two bodies overlap much at the start, the simulation is unstable, or there are too
    many contacts.
    """
    mujoco = loaded()
    model = _model(mujoco, bodies, engine, gravity, ground)
    standing = [number for number, body in enumerate(bodies) if body.entry.stands_on]
    if standing:
        bodies = stood(model, bodies, ground.height)
        model = _model(mujoco, bodies, engine, gravity, ground)
    data = mujoco.MjData(model)
    still = [number for number in standing if not _is_pushed(bodies[number].entry)]
    if still:
        settle(data, bodies, still)
    moved = start(data, bodies, gravity, engine.contact_seconds)
    recorder = _Recorder(model, data, bodies)
    every = max(1, round(1.0 / (PICTURES_PER_SECOND * engine.step_seconds)))
    steps = every * int(np.ceil(seconds / (every * engine.step_seconds)))
    for step in track(range(steps), "moving", unit="steps", visible=visible):
        if step % every == 0:
            recorder.take_pose()
        before = data.qvel.copy()
        mujoco.mj_step(model, data)
        if data.ncon:
            recorder.take_contacts(step, before)
            recorder.require_few((step + 1) * engine.step_seconds)
        if step % every == 0:
            recorder.require_calm(step * engine.step_seconds)
    return recorder.course(every * engine.step_seconds, moved)


def _is_pushed(entry: ObjectEntry) -> bool:
    return any(entry.velocity) or any(entry.spin)


def loaded() -> Any:
    """MuJoCo, whose warnings are logged; it would add them to a file in the present folder."""
    mujoco = scene_package("mujoco")
    mujoco.set_mju_user_warning(lambda text: warn_once(one_line(f"MuJoCo says: {text}")))
    return mujoco


def _model(
    mujoco: ModuleType,
    bodies: list[Body],
    engine: EngineEntry,
    gravity: Vector,
    ground: GroundPlane,
) -> Any:
    spec = mujoco.MjSpec()
    spec.option.timestep = engine.step_seconds
    spec.option.gravity = gravity
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.enableflags |= mujoco.mjtEnableBit.mjENBL_SLEEP
    # A quarter of the speed that a falling body gains meanwhile: none sleeps at the top of its
    # flight.
    gained = float(np.linalg.norm(gravity)) * STEPS_TO_SLEEP * engine.step_seconds
    spec.option.sleep_tolerance = max(0.25 * gained, SLOWEST_BODY)
    if ground.height is not None:
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_PLANE,
            size=[0.0, 0.0, 1.0],
            pos=[0.0, 0.0, ground.height],
            **_contact_options(engine, ground.material.friction, ground.material.restitution),
        )
    for number, body in enumerate(bodies):
        _add_body(mujoco, spec, engine, number, body)
    return spec.compile()


def _add_body(mujoco: ModuleType, spec: Any, engine: EngineEntry, number: int, body: Body) -> None:
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
    contacts = [
        _contact_options(engine, each.friction, each.restitution) for each in body.materials
    ]
    if body.radius is not None:
        size = [body.radius, 0.0, 0.0]
        added.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=size, **contacts[0])
    if body.cylinder is not None:
        _add_cylinder(mujoco, added, body.cylinder, contacts[body.of_parts[0]])
        return
    for part, (corners, material) in enumerate(zip(body.parts, body.of_parts)):
        name = f"{number} {part}"
        spec.add_mesh(name=name, uservert=corners.ravel().tolist())
        added.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, **contacts[material])


def _add_cylinder(
    mujoco: ModuleType, added: Any, cylinder: Cylinder, contact: dict[str, Any]
) -> None:
    added.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        pos=cylinder.centre.tolist(),
        zaxis=cylinder.axis.tolist(),
        size=[cylinder.radius, cylinder.half_length, 0.0],
        **contact,
    )


def _contact_options(engine: EngineEntry, friction: float, restitution: float) -> dict[str, Any]:
    stiff = (np.pi / engine.contact_seconds) ** 2
    ratio = damping_ratio(restitution, engine.steps)
    return {
        "friction": [friction, 0.0, 0.0],
        "solref": [-stiff, -2.0 * ratio * np.sqrt(stiff)],
        "solimp": _IMPEDANCE,
        "condim": 3,
    }


class _Recorder:
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
        """Record the contacts of a step; `velocities` are those at its beginning."""
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
        """Refuse more contacts than can be recorded."""
        rate = max(MOST_CONTACTS, MOST_CONTACTS_EACH * len(self.bodies))
        if self.log.count > min(rate * max(1.0, seconds), MOST_KEPT):
            raise UserError(
                f"found {self.log.count:,} contacts in the first {seconds:.3g} s (counted in every "
                f"step), expected at most {rate:,} a second and {MOST_KEPT:,} in all; take fewer "
                "objects, hull in place of parts, or fewer steps of the engine"
            )

    def require_calm(self, seconds: float) -> None:
        """Refuse a simulation that is unstable."""
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


@cache
def damping_ratio(restitution: float, steps: int) -> float:
    """Damping ratio of a spring and damper that push but never pull.

    The restitution is the speed after a bounce over that before it; `steps` is the number of the
    engine's steps in half a period of the spring.

    Examples
    --------
    >>> ratio = damping_ratio(0.5, 16)
    >>> bool(abs(restitution_of(ratio, 16) - 0.5) < 1e-9)
    True
    """
    if restitution >= restitution_of(0.0, steps):
        return 0.0
    if restitution <= restitution_of(MOST_DAMPED, steps):
        return MOST_DAMPED
    ratio = brentq(lambda each: restitution_of(each, steps) - restitution, 0.0, MOST_DAMPED)
    return float(ratio)


def restitution_of(ratio: float, steps: int) -> float:
    """Speed after a bounce over the speed before it, by the engine's own steps."""
    omega = np.pi / steps
    away = -(np.arange(PHASES) + 0.5) / PHASES
    speed = np.full(PHASES, -1.0)
    touching = np.ones(PHASES, dtype=bool)
    while touching.any():
        push = np.maximum(-(omega**2) * away - 2.0 * ratio * omega * speed, 0.0)
        touching &= (away < 0.0) & ((speed < 0.0) | (push > 0.0))
        speed = np.where(touching, speed + push, speed)
        away = np.where(touching, away + speed, away)
    return float(speed.mean())
