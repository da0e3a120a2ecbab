"""Objects of scenes that stand on something, and faults that are told before modes are found."""

import numpy as np
import pytest

from carillon.errors import UserError
from tests.scenes import ball, moved, require_engine, scene

BOWL = {"name": "bowl", "mesh": "builtin:bowl", "material": "steel", "count": 0}


def at_rest(*objects, **given):
    """Course of a scene whose objects stay where they are."""
    require_engine()
    bodies, course = moved(scene(*objects, **{"seconds": 0.4, **given}))
    heights = course.motion.positions[:, :, 2]
    assert np.abs(heights - heights[0]).max() < 2e-5
    assert course.resting[-1].sum() == sum(not body.entry.fixed for body in bodies)
    # None is so fast that one would hear it: half of what gravity makes in a bounce.
    speeds = np.abs(np.diff(heights, axis=0)) / course.motion.times[1]
    assert speeds.max() < 1e-3 and not course.moved
    return course


def test_a_bowl_stands_on_the_ground_whatever_its_size_and_the_grounds_height():
    small = at_rest({**BOWL, "stands_on": "ground"}).motion.positions[0, 0, 2]
    assert small == pytest.approx(0.04278, abs=1e-4)
    large = at_rest({**BOWL, "stands_on": "ground", "size": 0.5}, ground=-2.0)
    assert large.motion.positions[0, 0, 2] + 2.0 == pytest.approx(small * 0.5 / 0.16, rel=0.01)


def test_balls_stand_on_each_other_in_any_order():
    course = at_rest(
        ball("top", stands_on="middle"),
        ball("middle", stands_on="low"),
        ball("low", fixed=True, stands_on="ground"),
        friction_free(),
    )
    assert course.motion.positions[0, :3, 2] == pytest.approx([0.05, 0.03, 0.01], abs=1e-6)


def friction_free():
    """A ball aside, so that there is one on the ground, too."""
    return ball("aside", position=[0.5, 0.0, 0.0], stands_on="ground")


def test_a_ball_stands_within_a_bowl():
    course = at_rest({**BOWL, "stands_on": "ground"}, ball(stands_on="bowl"))
    bowl, inside = course.motion.positions[0, :, 2]
    assert inside < bowl + 0.02  # below its rim


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"stands_on": "table"}, "found 'table', expected one of ground$"),
        ({"stands_on": "grund"}, r"expected one of ground \(did you mean ground\?\)$"),
        ({"stands_on": "ball"}, "ball on ball: nothing carries them"),
        ({"stands_on": "ground", "position": [0, 0, 1]}, "whose z is 1, expected 0"),
    ],
)
def test_what_stands_on_nothing_is_refused(given, says):
    with pytest.raises(UserError, match=says):
        scene(ball(**given))


def test_a_mistake_is_told_with_the_name_of_its_object():
    with pytest.raises(UserError, match=r"^objects\[1\].radius \(marble\): found -1"):
        scene(ball(), ball("marble", radius=-1.0))
    with pytest.raises(UserError, match=r"^objects\[1\] \(marble\): there is no key 'raduis'"):
        scene(ball(), ball("marble", raduis=1.0))
    with pytest.raises(UserError, match=r"^objects\[1\].name: several objects are named 'ball'"):
        scene(ball(), ball())


def test_what_does_not_meet_its_support_or_has_no_ground_is_refused():
    require_engine()
    aside = ball("aside", position=[1.0, 0.0, 0.0], stands_on="below")
    with pytest.raises(UserError, match="'aside' at x = 1 m, y = 0 m does not meet object 'below'"):
        moved(scene(ball("below", stands_on="ground"), aside))
    with pytest.raises(UserError, match="there is no ground"):
        scene(ball(stands_on="ground"), ground=None)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"position": [0, 0, 0.01]}, "with stands_on: ground, or at a height"),
        ({"position": [0, 0, 5.0]}, "nothing touches anything"),
    ],
)
def test_faults_are_told_before_modes_are_found(given, says, monkeypatch):
    require_engine()
    import sound.scenes.playing.play as play

    def solved(_):
        raise AssertionError("modes were found first")

    monkeypatch.setattr(play, "with_modes", solved)
    with pytest.raises(UserError, match=says):
        play.perform(scene({**BOWL, "count": 20, **given}, seconds=0.1), 1, visible=False)


def test_what_tips_on_its_parts_rests_before_time_begins():
    """The bar's convex parts are off its surface by up to a tenth of a millimetre."""
    bar = {"mesh": "builtin:bar", "material": "steel", "count": 0}
    course = at_rest(
        {**bar, "name": "low", "stands_on": "ground"},
        {**bar, "name": "across", "rotation": [0.0, 0.0, 90.0], "stands_on": "low"},
    )
    assert np.abs(course.motion.rotations - course.motion.rotations[0]).max() < 1e-5


def test_what_cannot_stay_moves_and_what_stands_beside_it_rests():
    require_engine()
    bar = {"name": "bar", "mesh": "builtin:bar", "material": "steel", "stands_on": "ground"}
    slope = {"name": "slope", "mesh": "builtin:plate", "material": "steel", "fixed": True}
    slope |= {"position": [1.0, 0.0, 0.2], "rotation": [0.0, 40.0, 0.0]}
    rolls = ball("rolls", position=[1.0, 0.0, 0.0], stands_on="slope")
    _, course = moved(scene({**bar, "count": 0}, {**slope, "count": 0}, rolls, seconds=0.3))
    ways = np.linalg.norm(course.motion.positions - course.motion.positions[0], axis=2).max(axis=0)
    assert ways[0] < 2e-5 and ways[2] > 0.05


def test_what_stands_and_has_a_velocity_begins_with_it():
    require_engine()
    _, course = moved(scene(ball(stands_on="ground", velocity=[0.5, 0.0, 0.0]), seconds=0.1))
    assert 0.03 < course.motion.positions[-1, 0, 0] < 0.05  # friction lets it roll
