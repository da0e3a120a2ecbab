"""How loud the modes of a solid are heard, and the click of one that is pushed."""

import numpy as np
import pytest
import trimesh
from scipy.signal import freqz, lfilter
from scipy.spatial.transform import Rotation
from scipy.special import spherical_jn, spherical_yn

from sound.radiation.air import AIR_DENSITY, SOUND_SPEED
from sound.radiation.sphere import Radiation, radiated
from sound.scenes.audible.loudness import (
    acceleration_filter,
    equivalent_radius,
)
from sound.shape import Shape
from tests.radiation_bem import approximation, level, sphere_pressure, vibrating_solid

RADIUS = 0.05
FREQUENCIES = np.array([300.0, 1000.0, 4000.0])
FACETED = 0.01
"""Relative error of a sphere of 5,120 triangles, whose surface is 0.2 % too small."""
BAR = (10.20, 12.30, 5.85, 21.16, 17.62, 14.86, 20.94, 20.58)
"""Level [dB re 1 Pa m / (kg^-1/2 N s)] of a steel bar in its modes, by `tests.radiation_bem`."""


@pytest.fixture(scope="module")
def ball() -> trimesh.Trimesh:
    return trimesh.creation.icosphere(subdivisions=4, radius=RADIUS)


def cube(side: float = 0.1) -> trimesh.Trimesh:
    """A cube about the origin with triangles at most an eighth of it long."""
    surface = trimesh.creation.box(extents=(side, side, side))
    vertices, faces = trimesh.remesh.subdivide_to_size(surface.vertices, surface.faces, side / 8)
    surface = trimesh.Trimesh(vertices, faces, process=False)
    surface.merge_vertices()
    return surface


def hertz(ka: float, count: int = 1) -> np.ndarray:
    return np.full(count, ka / RADIUS * SOUND_SPEED / (2.0 * np.pi))


def shape_of(vertices: np.ndarray, faces: np.ndarray) -> Shape:
    return Shape.of_surface(np.asarray(vertices), np.asarray(faces), np.zeros(3))


def heard(surface: trimesh.Trimesh, motion: np.ndarray, frequencies: np.ndarray) -> Radiation:
    return radiated(motion, shape_of(surface.vertices, surface.faces), frequencies)


def power(found: Radiation) -> np.ndarray:
    """Mean of (monopole + dipole . n)^2 over all directions."""
    return found.monopoles**2 + (found.dipoles**2).sum(axis=1) / 3.0


def some_modes(surface: trimesh.Trimesh) -> np.ndarray:
    """Displacements (V, 3, 3) with a monopole, a dipole and more."""
    x = np.asarray(surface.vertices) / RADIUS
    bent = np.stack([x[:, 1] ** 2, 0.3 * x[:, 0], x[:, 0] * x[:, 2]], axis=1)
    swollen = x * (1.0 + x[:, :1])
    return np.stack([bent, swollen, np.sin(2.0 * x)], axis=2)


@pytest.mark.parametrize("ka", [0.01, 0.3, 1.5, 8.0])
def test_a_pulsating_sphere_is_the_exact_monopole(ball, ka):
    found = heard(ball, np.asarray(ball.vertices)[:, :, None] / RADIUS, hertz(ka))
    exact = AIR_DENSITY * SOUND_SPEED * ka * RADIUS / np.sqrt(1.0 + ka**2)
    assert found.monopoles == pytest.approx([exact], rel=FACETED)
    assert np.abs(found.dipoles).max() < 1e-6 * exact


@pytest.mark.parametrize("ka", [0.01, 0.3, 1.5, 8.0])
def test_a_swinging_sphere_is_the_exact_dipole_the_way_it_swings(ball, ka):
    way = np.array([0.6, 0.0, -0.8])
    found = heard(ball, np.broadcast_to(way[:, None], (len(ball.vertices), 3, 1)), hertz(ka))
    exact = sphere_pressure(1, np.array(ka / RADIUS), RADIUS)
    assert found.dipoles[0] == pytest.approx(exact * way, rel=FACETED, abs=1e-6 * exact)
    assert abs(found.monopoles[0]) < 1e-3 * exact


def test_a_slowly_swinging_sphere_takes_half_its_volume_of_air_along(ball):
    ka = 1e-3
    found = heard(
        ball, np.broadcast_to([[0.0], [0.0], [1.0]], (len(ball.vertices), 3, 1)), hertz(ka)
    )
    moved = 1.5 * 4.0 / 3.0 * np.pi * RADIUS**3
    number = ka / RADIUS
    exact = AIR_DENSITY * SOUND_SPEED * number**2 * moved / (4.0 * np.pi)
    assert found.dipoles[0, 2] == pytest.approx(exact, rel=FACETED)


@pytest.mark.parametrize("ka", [0.01, 0.3, 1.5, 8.0])
def test_a_sphere_that_flattens_radiates_the_exact_power(ball, ka):
    outward = np.asarray(ball.vertices)[:, :, None] / RADIUS
    flat = outward * (1.5 * outward[:, 2:] ** 2 - 0.5)
    saddle = outward * outward[:, :1] * outward[:, 1:2]
    found = heard(ball, np.concatenate([flat, saddle], axis=2), hertz(ka, 2))
    exact = sphere_pressure(2, np.array(ka / RADIUS), RADIUS) ** 2
    assert power(found) == pytest.approx(exact * np.array([1 / 5, 1 / 15]), rel=2 * FACETED)


def test_orders_add_up_in_power_and_the_monopole_keeps_its_sign(ball):
    outward = np.asarray(ball.vertices)[:, :, None] / RADIUS
    flat = outward * (1.5 * outward[:, 2:] ** 2 - 0.5)
    single = heard(ball, np.concatenate([outward, flat], axis=2), hertz(1.0, 2))
    joint = heard(ball, np.concatenate([outward + flat, flat - outward], axis=2), hertz(1.0, 2))
    assert power(joint) == pytest.approx([power(single).sum()] * 2, rel=FACETED)
    assert joint.monopoles[0] == pytest.approx(-joint.monopoles[1], rel=FACETED)
    assert joint.monopoles[0] > 0.0


def test_volume_that_a_solid_displaces_slowly_is_heard_whatever_its_shape():
    box = cube()
    motion = np.zeros((len(box.vertices), 3, 1))
    motion[box.vertices[:, 2] > 0.0499, 2] = 1.0  # the lid
    found = heard(box, motion, np.array([5.0]))
    exact = AIR_DENSITY * 2.0 * np.pi * 5.0 * 0.1**2 / (4.0 * np.pi)
    assert found.monopoles == pytest.approx([exact], rel=1e-3)


def test_a_cube_that_keeps_its_volume_has_no_monopole_at_low_frequencies():
    box = cube()
    x = np.asarray(box.vertices)
    motion = np.stack([x, x * [1.0, 1.0, -2.0]], axis=2)
    swells, keeps = heard(box, motion, np.full(2, 20.0)).monopoles
    assert abs(keeps) < 1e-3 * swells
    faster = heard(box, motion, np.full(2, 40.0)).monopoles
    assert faster[0] / swells == pytest.approx(2.0, rel=1e-2)
    assert faster[1] / keeps == pytest.approx(8.0, rel=1e-2)  # order 2 alone


def test_a_larger_solid_at_a_lower_frequency_is_louder_by_its_size(ball):
    motion = some_modes(ball)
    found = heard(ball, motion, FREQUENCIES)
    vertices = 3.0 * np.asarray(ball.vertices)
    larger = radiated(motion, shape_of(vertices, ball.faces), FREQUENCIES / 3.0)
    assert larger.monopoles == pytest.approx(3.0 * found.monopoles, rel=1e-9)
    assert larger.dipoles == pytest.approx(3.0 * found.dipoles, rel=1e-9)


def test_a_turned_solid_has_turned_dipoles():
    box = cube()
    motion = some_modes(box)
    found = heard(box, motion, FREQUENCIES)
    turn = Rotation.from_euler("xyz", [20.0, 50.0, 110.0], degrees=True).as_matrix()
    vertices = np.asarray(box.vertices) @ turn.T
    turned = radiated(
        np.einsum("ij,vjn->vin", turn, motion), shape_of(vertices, box.faces), FREQUENCIES
    )
    assert turned.dipoles == pytest.approx(found.dipoles @ turn.T, rel=1e-6, abs=1e-9)
    assert turned.monopoles == pytest.approx(found.monopoles, rel=0.01)  # directions are not turned


@pytest.mark.parametrize("change", ["some turned", "one of no area more"])
def test_the_way_that_triangles_face_and_those_without_area_do_not_matter(ball, change):
    motion, found = some_modes(ball), heard(ball, some_modes(ball), FREQUENCIES)
    faces = np.array(ball.faces)
    if change == "some turned":
        faces[::3] = faces[::3, ::-1]
    else:
        faces = np.concatenate([faces, [[5, 5, 7]]])
    changed = radiated(motion, shape_of(ball.vertices, faces), FREQUENCIES)
    assert changed.monopoles == pytest.approx(found.monopoles, rel=1e-9)
    assert changed.dipoles == pytest.approx(found.dipoles, rel=1e-9, abs=1e-9)


def test_an_open_surface_is_heard_nearly_as_the_closed_one(ball):
    motion = some_modes(ball)
    hole = ball.triangles_center[:, 2] > 0.97 * RADIUS
    faces = np.array(ball.faces)[~hole]
    assert 0 < np.count_nonzero(hole) < 0.02 * len(hole)
    found = power(radiated(motion, shape_of(ball.vertices, faces), FREQUENCIES))
    assert found == pytest.approx(power(heard(ball, motion, FREQUENCIES)), rel=0.1)


def test_a_bar_is_as_loud_as_by_the_boundary_element_method():
    """The approximation is 0.9 dB off, rms, and 1.9 dB at most."""
    assert level(approximation(vibrating_solid("bar", 1400)).rms ** 2) == pytest.approx(
        BAR, abs=2.5
    )


def sphere_transfer(radius: float, frequencies: np.ndarray) -> np.ndarray:
    """Pressure times distance over acceleration, from the exact field of order 1."""
    number = 2.0 * np.pi * frequencies / SOUND_SPEED
    x = number * radius
    slope = spherical_jn(1, x, True) + 1j * spherical_yn(1, x, True)
    speed = 1.0 / (-2j * np.pi * frequencies)
    # h_1 of the distance is -exp(ikr) / (kr); the time from the surface on is taken off.
    field = -1j * AIR_DENSITY * SOUND_SPEED * speed / (number * slope)
    return np.conj(field * np.exp(1j * x))


@pytest.mark.parametrize("radius", [0.0005, 0.002, 0.01, 0.03, 0.1, 0.5])
@pytest.mark.parametrize("rate", [44_100, 48_000])
def test_the_filter_is_a_sphere_below_ten_kilohertz(radius, rate):
    frequencies = np.geomspace(10.0, 10_000.0, 200)
    found = freqz(*acceleration_filter(radius, rate), frequencies, fs=rate)[1]
    ratio = found / sphere_transfer(radius, frequencies)
    assert np.abs(20.0 * np.log10(np.abs(ratio))).max() < 0.06
    # Its phase is off by less than half a sample.
    assert np.abs(np.angle(ratio) / (2.0 * np.pi * frequencies) * rate).max() < 0.5


def test_a_push_sounds_along_its_way_and_steady_acceleration_is_silent():
    acceleration = np.zeros((4000, 3))
    acceleration[100:, 1] = -9.81
    sound = lfilter(*acceleration_filter(0.03, 44_100), acceleration, axis=0)
    assert not sound[:, [0, 2]].any()
    assert sound[100, 1] < 0.0 and not sound[:100].any()
    assert abs(sound[-1, 1]) < 1e-9 * np.abs(sound).max()


def test_the_click_is_that_of_a_sphere_of_the_same_volume_that_swings(ball):
    swing = np.broadcast_to([[1.0], [0.0], [0.0]], (len(ball.vertices), 3, 1))
    dipole = heard(ball, swing, np.array([2000.0])).dipoles[0, 0]
    transfer = sphere_transfer(equivalent_radius(ball.volume), np.array([2000.0]))[0]
    assert 2.0 * np.pi * 2000.0 * abs(transfer) == pytest.approx(dipole, rel=FACETED)
