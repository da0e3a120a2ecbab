"""Cameras that no scene describes see what happens, near enough to tell what it is."""

import numpy as np
import pytest

from sound.scenes.bodies import bodies_of
from sound.scenes.film.rays import View
from sound.scenes.performance import Camera, Motion
from sound.scenes.playing.play import ASPECT, camera_of, head_of
from tests.scenes import ball, scene

HEIGHT = 720
SIZE = (round(ASPECT * HEIGHT), HEIGHT)
COUNT = 9
RADII = 0.02 + 0.01 * np.arange(COUNT)
SCENE = scene(
    *(ball(f"{number}", radius=radius, position=[number, 0.0, 0.5], fixed=number > 0)
      for number, radius in enumerate(RADII.tolist()))
)  # fmt: skip
ALONG = {"wide": (1.0, 0.0, 0.0), "deep": (0.0, 1.0, 0.0), "tall": (0.0, 0.0, 1.0)}


def motion(places: np.ndarray) -> Motion:
    """Places (T, B, 3) one second after another."""
    times = np.arange(float(len(places)))
    return Motion(times, places, np.tile([1.0, 0.0, 0.0, 0.0], (*places.shape[:2], 1)))


def window(camera: Camera, places: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Left, right, top and bottom of what balls take in the picture, in shares of it."""
    view = View(camera, SIZE)
    seen = (places - view.eye) @ view.axes.T
    middles, halves = seen[:, :2] / seen[:, 2:], radii / seen[:, 2]
    low, high = middles - halves[:, None], middles + halves[:, None]
    return (np.stack([low.min(axis=0), high.max(axis=0)]) * view.focus / SIZE + 0.5).T.ravel()


@pytest.mark.parametrize("along", ALONG)
def test_all_is_seen_and_nearly_fills_the_picture(along):
    places = np.linspace(-0.6, 0.6, COUNT)[:, None] * ALONG[along] + [3.0, 1.0, 2.0]
    camera = camera_of(SCENE.camera, bodies_of(SCENE.objects), motion(np.stack([places, places])))
    left, right, top, bottom = window(camera, places, RADII)
    assert 0.0 < left < right < 1.0 and 0.0 < top < bottom < 1.0
    assert max(right - left, bottom - top) > 0.85
    first, last = max(((left, right), (top, bottom)), key=lambda ends: ends[1] - ends[0])
    assert first + last == pytest.approx(1.0, abs=0.02)


def test_what_rolls_far_away_makes_the_others_no_smaller():
    places = np.linspace(-0.6, 0.6, COUNT)[:, None] * ALONG["wide"]
    staying = np.stack([places] * 20)
    leaving = staying.copy()
    leaving[:, 0, 0] -= np.linspace(0.0, 100.0, 20)
    bodies = bodies_of(SCENE.objects)
    near, far = (camera_of(SCENE.camera, bodies, motion(each)) for each in (staying, leaving))
    assert far == near


def test_who_hears_is_where_the_camera_is():
    places = np.linspace(-0.6, 0.6, COUNT)[:, None] * ALONG["wide"]
    camera = camera_of(SCENE.camera, bodies_of(SCENE.objects), motion(np.stack([places, places])))
    head = head_of(SCENE.listener, camera)
    np.testing.assert_array_equal(head.at(np.zeros(1))[0], [camera.position])
