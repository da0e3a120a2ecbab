"""Directivities of modes, and boundary elements beside what is known of spheres."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from carillon.errors import UserError
from sound.radiation import boundary_elements
from sound.radiation.boundary_mesh import BoundaryMesh, boundary_mesh
from sound.radiation.directivity import Directivity, even_directions, harmonics
from sound.radiation.modes_directivity import modes_directivity
from sound.radiation.sphere import radiated
from sound.shape import Shape
from sound.strikes import struck_surface
from sound.synthesis.driven import Gains, ring
from tests.radiation_bem import CHECKED, VibratingSurface, by_elements, sphere, sphere_pressure
from tests.radiation_bem import RADIUS as BALL_RADIUS
from tests.scenes import strikes_alone

RATE = 44_100


def random_directivity(modes: int = 3, order: int = 4) -> Directivity:
    rng = np.random.default_rng(7)
    shape = (modes, (order + 1) ** 2)
    return Directivity(rng.normal(size=shape) + 1j * rng.normal(size=shape))


def test_harmonics_are_orthonormal_on_directions_of_twice_their_order():
    directions, shares = even_directions(12)
    values = harmonics(6, directions)
    assert values.T @ (shares[:, None] * values) == pytest.approx(np.eye(49), abs=1e-12)


def test_a_monopole_and_a_dipole_are_heard_by_their_sum():
    rng = np.random.default_rng(3)
    monopoles, dipoles = rng.normal(size=4), rng.normal(size=(4, 3))
    directions, _ = even_directions(5)
    found = Directivity.of_dipoles(monopoles, dipoles).towards(directions)
    assert found == pytest.approx(monopoles + directions @ dipoles.T, abs=1e-12)


def test_the_rms_is_that_over_all_directions():
    directivity = random_directivity()
    directions, shares = even_directions(2 * directivity.order)
    square = shares @ np.abs(directivity.towards(directions)) ** 2
    assert directivity.rms == pytest.approx(np.sqrt(square), rel=1e-12)


def test_modes_after_others_keep_their_directivity_whatever_the_orders():
    low, high = random_directivity(2, 4), random_directivity(5, 1)
    joined = low.with_modes_after(high)
    directions, _ = even_directions(6)
    expected = np.hstack([low.towards(directions), high.towards(directions)[:, 2:]])
    assert joined.towards(directions) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("triangles", [1000, 3000])
def test_a_boundary_mesh_is_closed_even_and_as_large_as_the_solid(triangles):
    bowl = struck_surface("builtin:bowl")
    mesh = boundary_mesh(bowl.vertices, bowl.faces, triangles)
    found = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    assert found.is_watertight and len(mesh.faces) <= triangles
    assert found.volume == pytest.approx(bowl.volume, rel=0.06)
    edges = found.edges_unique_length
    assert edges.max() < 4.0 * np.median(edges)


def test_an_open_surface_has_no_boundary_mesh():
    box = trimesh.creation.box()
    with pytest.raises(UserError, match="open"):
        boundary_mesh(box.vertices, box.faces[2:], 1000)


def test_flows_of_a_moved_and_of_a_swelling_body_are_none_and_thrice_its_volume():
    box = trimesh.creation.box([0.1, 0.2, 0.3])
    mesh = boundary_mesh(box.vertices, box.faces, 500)
    moved = np.broadcast_to([0.3, -0.2, 0.7], mesh.middles.shape)
    flows = mesh.flows(np.stack([moved, mesh.middles], axis=2)).sum(axis=0)
    volume = trimesh.Trimesh(mesh.vertices, mesh.faces).volume
    assert flows == pytest.approx([0.0, 3.0 * volume], abs=1e-12)


def test_products_of_hat_functions_add_up_to_the_area():
    ball = trimesh.creation.icosphere(subdivisions=2)
    mesh = BoundaryMesh(np.asarray(ball.vertices), np.asarray(ball.faces))
    products = mesh.hat_products()
    assert products.sum() == pytest.approx(ball.area)
    assert products == pytest.approx(products.T)


def test_modes_of_about_one_frequency_share_a_system():
    groups = boundary_elements.same_frequency(np.array([100.0, 100.1, 100.19, 100.3, 250.0]))
    assert groups == [slice(0, 3), slice(3, 4), slice(4, 5)]


def test_a_gain_of_a_quarter_period_shifts_a_mode_by_it():
    hertz, damping, count = 441.0, 4.0, 4410
    act = strikes_alone(np.zeros(1, np.int64), np.zeros(1), np.zeros(1), np.ones((1, 1)))
    found = [
        ring(
            np.array([hertz]), np.array([damping]), Gains.constant(np.array([g])), act, count, RATE
        )
        for g in (1.0, 1.0j)
    ]
    seconds = np.arange(count) / RATE
    decay = np.exp(-damping * seconds)
    pulse = found[1][0]  # what the one sample of force leaves
    assert found[0] == pytest.approx(pulse * decay * np.sin(2 * np.pi * hertz * seconds), abs=1e-9)
    assert found[1] == pytest.approx(pulse * decay * np.cos(2 * np.pi * hertz * seconds), abs=1e-9)


def test_gains_between_frames_are_linear_and_hold_after_the_last():
    count = 600
    act = strikes_alone(np.zeros(1, np.int64), np.zeros(1), np.zeros(1), np.ones((1, 2)))
    hertz, dampings = np.array([300.0, 700.0]), np.array([2.0, 3.0])
    frames = np.array([0.0, 100.5, 333.0])
    values = np.array([[1.0, 0.0], [0.5 + 1.0j, 2.0], [-1.0, 1.0j]])
    found = ring(hertz, dampings, Gains(frames, values), act, count, RATE)
    places = np.arange(count)
    expected = np.zeros(count)
    for mode in range(2):
        course = np.interp(places, frames, values[:, mode].real)
        quarter = np.interp(places, frames, values[:, mode].imag)
        alone = [np.eye(2)[mode] * factor for factor in (1.0, 1.0j)]
        plain, turned = (
            ring(hertz, dampings, Gains.constant(each), act, count, RATE) for each in alone
        )
        expected += course * plain + quarter * turned
    assert found == pytest.approx(expected, abs=1e-9)


def a_shape() -> Shape:
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.05)
    return Shape.of_surface(np.asarray(ball.vertices), np.asarray(ball.faces), np.zeros(3))


def swelling(places: np.ndarray) -> np.ndarray:
    return np.repeat(places[:, :, None], 2, axis=2)


def test_missing_boundary_elements_are_told_with_what_to_install(monkeypatch):
    monkeypatch.setattr(boundary_elements, "find_spec", lambda name: None)
    with pytest.raises(UserError, match="not installed; pip install -r .*radiation.txt"):
        modes_directivity("ball", a_shape(), swelling, np.array([500.0, 900.0]))


def test_modes_that_nobody_hears_take_no_boundary_elements(monkeypatch):
    monkeypatch.setattr(boundary_elements, "find_spec", lambda name: None)
    shape, hertz = a_shape(), np.array([25_000.0, 30_000.0])
    found = modes_directivity("ball", shape, swelling, hertz)
    expected = radiated(swelling(shape.vertices), shape, hertz).directivity
    assert found.coefficients == pytest.approx(expected.coefficients)


def test_an_open_surface_is_heard_as_its_sphere_and_a_line_tells(capsys):
    shape = a_shape()
    opened = Shape(shape.vertices, shape.faces[3:], shape.inward, shape.radii)
    hertz = np.array([500.0, 900.0])
    found = modes_directivity("lamp", opened, swelling, hertz)
    expected = radiated(swelling(opened.vertices), opened, hertz).directivity
    assert found.coefficients == pytest.approx(expected.coefficients)
    assert "'lamp' is heard as a sphere" in capsys.readouterr().err


@pytest.fixture
def _bempp():
    pytest.importorskip("bempp_cl", reason="bempp-cl is not installed (requirements-radiation.txt)")
    pytest.importorskip("pyopencl", reason="OpenCL is not installed (requirements-radiation.txt)")


@pytest.mark.usefixtures("_bempp")
@pytest.mark.parametrize("ka", CHECKED)
def test_boundary_elements_hear_a_sphere_as_theory_does(ka):
    found = by_elements(sphere(ka))
    number = np.array(ka / BALL_RADIUS)
    exact = [sphere_pressure(n, number, BALL_RADIUS) / np.sqrt(2 * n + 1) for n in range(3)]
    assert 20.0 * np.log10(found.rms / exact) == pytest.approx(np.zeros(3), abs=0.25)


@pytest.mark.usefixtures("_bempp")
def test_a_turned_solid_has_a_turned_directivity():
    ball = sphere(2.0)
    turn = Rotation.from_euler("xyz", [20.0, 50.0, 110.0], degrees=True).as_matrix()
    mesh = BoundaryMesh(ball.mesh.vertices @ turn.T, ball.mesh.faces)
    motion = np.einsum("ij,vjn->vin", turn, ball.motion)
    turned = by_elements(VibratingSurface(mesh, motion, ball.frequencies))
    directions, _ = even_directions(8)
    expected = by_elements(ball).towards(directions)
    assert turned.towards(directions @ turn.T) == pytest.approx(expected, rel=1e-3, abs=1e-3)
