"""How bodies of a scene move and strike each other, beside theory."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from carillon.errors import UserError
from sound.scenes.contact import engine
from sound.scenes.contact.engine import damping_ratio, restitution_of
from sound.scenes.hertz import approach, bounce_seconds, stiffness
from sound.scenes.performance import GROUND
from tests.scenes import ball, moved, require_engine, scene, struck

G = 9.81
BLOCK = {"name": "block", "mesh": "builtin:box", "material": "wood", "count": 0, "resolution": 12}


@pytest.fixture(autouse=True)
def _engine():
    require_engine()


@pytest.mark.parametrize("restitution", [0.9, 0.7, 0.4])
def test_a_ball_bounces_when_and_as_fast_as_theory_says(restitution):
    height = 0.25
    described = scene(
        ball(position=[0, 0, height + 0.01], restitution=restitution),
        seconds=2.0,
        engine={"steps": 64},
    )
    described = _with_ground(described, restitution)
    (body,), impacts, _ = struck(described)
    speed, time = np.sqrt(2 * G * height), np.sqrt(2 * height / G)
    for number, contact in enumerate(impacts[:4]):
        # Theory's bounces take no time, the engine's some.
        late = number * described.engine.contact_seconds + 1e-3 * time
        assert contact.impact.seconds == pytest.approx(time, abs=late)
        # What is held to the ground is slowed by its weight.
        slowed = number * G * described.engine.contact_seconds
        assert contact.impact.speed == pytest.approx(speed, abs=0.01 * speed + slowed)
        gained = np.linalg.norm(contact.impact.impulse) / body.mass
        lifted = G * described.engine.contact_seconds
        assert gained == pytest.approx(
            (1 + restitution) * speed + lifted, abs=0.01 * speed + 2 * slowed
        )
        speed *= restitution
        time += 2 * speed / G


def test_the_energy_of_a_bouncing_ball_falls_by_the_square_of_its_restitution():
    described = _with_ground(scene(ball(position=[0, 0, 0.51], restitution=0.8), seconds=2.5), 0.8)
    (body,), course = moved(described)
    heights = course.motion.positions[:, 0, 2] - 0.01
    tops = heights[1:-1][(heights[1:-1] > heights[:-2]) & (heights[1:-1] >= heights[2:])]
    ratios = np.array([after / before for before, after in pairwise([0.5, *tops[:4]])])
    assert ratios == pytest.approx(0.8**2, rel=0.03)
    assert np.all(heights > -1.1 * np.sqrt(2 * G * 0.5) * described.engine.contact_seconds / np.pi)


def test_momentum_goes_from_a_ball_to_one_of_its_kind():
    described = scene(
        ball("first", position=[-0.1, 0, 0], velocity=[1, 0, 0], restitution=0.98, friction=0),
        ball("second", restitution=0.98, friction=0),
        gravity=[0, 0, 0],
        ground=None,
        seconds=0.3,
    )
    _, course = moved(described)
    last = course.motion.positions[-1] - course.motion.positions[-10]
    speeds = last[:, 0] / (course.motion.times[-1] - course.motion.times[-10])
    assert speeds.sum() == pytest.approx(1.0, abs=1e-6)
    assert speeds == pytest.approx([0.01, 0.99], abs=0.012)


def test_impacts_are_told_with_their_pair_place_and_direction():
    described = scene(
        ball("thrown", position=[-0.1, 0, 0], velocity=[1, 0, 0]),
        ball("still"),
        gravity=[0, 0, 0],
        ground=None,
        seconds=0.2,
    )
    _, impacts, _ = struck(described)
    (contact,) = impacts
    assert contact.impact.pair == (1, 0)
    assert contact.impact.position == pytest.approx([-0.01, 0, 0], abs=5e-4)
    assert contact.impact.impulse[0] > 0.0 and abs(contact.impact.impulse[1:]).max() < 1e-9
    assert contact.impulses[:, 0] == pytest.approx(-contact.impulses[:, 1])


def test_what_lands_presses_with_its_weight_and_then_sleeps():
    described = scene({**BLOCK, "position": [0, 0, 0.2]}, seconds=2.0)
    (body,), impacts, (sustained,) = struck(described)
    assert sustained.pair == (0, GROUND)
    steps = sustained.contacts.steps
    late = steps > steps[-1] - 200
    weight = sustained.contacts.pressures[late].sum() / 200
    # It falls asleep before it has quite settled.
    assert weight == pytest.approx(body.mass * G, rel=0.3)
    assert impacts[-1].impact.seconds <= steps[-1] * described.engine.step_seconds < 1.0


def test_sliding_is_slowed_by_friction():
    bodies, _ = moved(scene({**BLOCK, "position": [0, 0, 1]}, seconds=0.01))
    half = -float(bodies[0].shape.vertices[:, 2].min())
    given = {"position": [0, 0, half], "velocity": [1, 0, 0], "friction": 0.3}
    described = scene({**BLOCK, **given}, seconds=1.0)
    (body,), course = moved(described)
    friction = max(0.3, described.ground_material.friction)
    assert course.motion.positions[-1, 0, 0] == pytest.approx(1.0 / (2 * friction * G), rel=0.05)


def test_hertz_contact_lasts_as_long_as_its_equation_of_motion_says():
    mass, radius, modulus, speed = 0.033, 0.01, 1.1e11, 1.3

    def course(_, state):
        depth, velocity = state
        force = 4 / 3 * modulus * np.sqrt(radius) * max(depth, 0.0) ** 1.5
        return [velocity, -force / mass]

    def apart(time, state):
        return state[0] if time > 1e-6 else 1.0

    apart.terminal, apart.direction = True, -1
    solved = solve_ivp(
        course, (0, 1e-3), [0, speed], events=apart, rtol=1e-10, atol=1e-15, max_step=1e-6
    )
    told = bounce_seconds(mass, radius, modulus, speed)
    assert told == pytest.approx(solved.t_events[0][0], rel=1e-3)


def test_impacts_last_as_hertz_says_of_both_materials():
    described = scene(ball(position=[0, 0, 0.06]), ground_material="glass", seconds=0.3)
    (body,), impacts, _ = struck(described)
    glass, steel = described.ground_material, body.entry.made_of
    giving = (1 - glass.poisson**2) / glass.young + (1 - steel.poisson**2) / steel.young
    expected = bounce_seconds(body.mass, 0.01, 1 / giving, np.sqrt(2 * G * 0.05))
    assert impacts[0].impact.duration == pytest.approx(expected, rel=0.01)


def test_a_contact_is_as_stiff_as_its_force_grows():
    force = np.array([3.0])
    step = 1e-6
    depths = approach(force * (1 + np.array([-step, step])), 0.02, 5e10)
    assert stiffness(force, 0.02, 5e10) == pytest.approx(2 * step * 3.0 / np.diff(depths), rel=1e-4)


@pytest.mark.parametrize("steps", [16, 64, 200])
def test_damping_lets_a_bounce_leave_what_it_shall(steps):
    for restitution in (0.2, 0.5, 0.9):
        assert restitution_of(damping_ratio(restitution, steps), steps) == pytest.approx(
            restitution
        )
    assert damping_ratio(1.0, steps) == 0.0


def test_a_start_at_which_two_overlap_is_refused():
    described = scene(ball("one"), ball("other", position=[0.015, 0, 0]), ground=None)
    with pytest.raises(UserError, match="'other' and object 'one' overlap by 5 mm"):
        moved(described)
    with pytest.raises(UserError, match="object 'one' and the ground overlap by 1 cm") as refused:
        moved(scene(ball("one")))
    assert str(refused.value).endswith("with stands_on: ground, or at a height (z) of 0.01 m")


def bowl(height):
    given = {"name": "bowl", "mesh": "builtin:bowl", "material": "steel", "count": 0}
    return {**given, "position": [0, 0, height]}


def test_a_bowl_that_overlaps_the_ground_a_little_is_lifted_and_rests(capsys):
    (made,), course = moved(scene(bowl(0.0417), seconds=0.5))
    heights = course.motion.positions[:, 0, 2]
    (lifted,) = course.moved.values()
    lowest = min(part[:, 2].min() for part in made.parts)
    assert heights[0] == pytest.approx(-lowest, abs=1e-7)
    assert lifted == pytest.approx([0, 0, -lowest - 0.0417], abs=1e-7)
    # What is left, and what its weight presses it in by.
    assert np.abs(heights - heights[0]).max() < 2e-5
    assert f"object 'bowl' from the ground by {1e3 * lifted[2]:.3g} mm" in capsys.readouterr().err


def test_the_height_that_a_refusal_names_is_one_at_which_the_bowl_rests():
    with pytest.raises(UserError, match="object 'bowl' and the ground overlap by") as refused:
        moved(scene(bowl(0.04), seconds=0.1))
    height = float(str(refused.value).split()[-2])
    _, course = moved(scene(bowl(height), seconds=0.3))
    assert not course.moved
    heights = course.motion.positions[:, 0, 2]
    # Parts of a bowl are no smooth ball: it may lean, but does not leap.
    assert heights.max() <= height + 1e-6 and np.ptp(heights) < 5e-4


@pytest.mark.parametrize("fixed", [False, True])
def test_of_a_stack_that_overlaps_each_is_lifted_by_what_is_below_it(fixed):
    step = 0.0199
    balls = [ball(str(n), position=[0, 0, 0.01 + step * n], friction=0) for n in range(3)]
    balls[0]["fixed"] = fixed
    _, course = moved(scene(*balls, seconds=0.05))
    assert {n: way[2] for n, way in course.moved.items()} == pytest.approx(
        {1: 1e-4, 2: 2e-4}, abs=2e-7
    )
    assert np.abs(course.motion.positions - course.motion.positions[0]).max() < 1e-5


def test_what_overlaps_sideways_is_moved_to_both_sides_and_stays_there():
    row = [ball(str(n), position=[0.0199 * n, 0, 0.01]) for n in range(3)]
    _, course = moved(scene(*row, seconds=0.2))
    places = course.motion.positions
    assert np.diff(places[0, :, 0]) == pytest.approx(0.02, abs=1e-7)
    assert places[0].mean(axis=0) == pytest.approx([0.0199, 0, 0.01], abs=1e-9)
    assert np.abs(places - places[0]).max() < 1e-5


def test_the_position_that_a_refusal_names_is_clear_of_the_other():
    still = ball("still", position=[0.3, 0.2, 0.5], fixed=True)
    with pytest.raises(UserError, match="'free' would be clear at the position") as refused:
        moved(scene(still, ball("free", position=[0.307, 0.205, 0.509])))
    place = [float(x) for x in str(refused.value).split("[")[1].rstrip("]").split(",")]
    _, course = moved(scene(still, ball("free", position=place), seconds=0.01))
    assert not course.moved


def test_what_has_no_room_to_be_moved_apart_is_refused():
    walls = [ball(f"wall {x:g}", position=[x, 0, 0], fixed=True) for x in (-0.0199, 0.0199)]
    with pytest.raises(UserError, match="too closely packed"):
        moved(scene(*walls, ball("between"), ground=None, gravity=[0, 0, 0]))


def test_a_start_without_overlap_is_left_as_it_is():
    _, course = moved(scene(ball(position=[0, 0, 0.01]), seconds=0.05))
    assert not course.moved and (course.motion.positions[0] == [0, 0, 0.01]).all()


def _with_ground(described, restitution):
    """The same on a ground that leaves a bounce as much."""
    material = replace(described.ground_material, restitution=restitution)
    return replace(described, ground_material=material)


def test_the_engine_leaves_no_file_of_warnings(tmp_path, monkeypatch, caplog):
    """Which might be a link of a stranger's to some other file."""
    monkeypatch.chdir(tmp_path)
    mujoco = engine.loaded()
    body = "<body><freejoint/><geom size='1'/></body>"
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    data = mujoco.MjData(model)
    data.qpos[:] = np.nan
    with caplog.at_level("WARNING"):
        mujoco.mj_step(model, data)
    assert list(tmp_path.iterdir()) == []
    assert "MuJoCo says: Nan, Inf or huge value in QPOS" in caplog.text
