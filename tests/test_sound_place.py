"""Designs for a place: transfers to it, derivatives of what is heard there, and its sound."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.interpolate import CubicSpline

from carillon.errors import UserError
from carillon.fem.model import mass_properties
from solver.files.modes_file import ModesFile, frequencies
from solver.response.vertices import inward_normals
from sound.design.objective import Objective
from sound.design.optimise import optimise
from sound.design.place import transfer_of
from sound.design.preparation import prepare
from sound.design.resolved import heard_energies
from sound.export.modal_model import ModalModel
from sound.project.design import Design
from sound.project.design_file import read_design, write_design
from sound.project.project import project_of
from sound.radiation.far_place import FarPlace
from sound.radiation.place import transfer_to
from sound.radiation.plane_waves import AGREED, adapted
from sound.radiation.sphere import (
    radiated,
    sphere_directivity,
    sphere_fields,
    surface_points,
)
from sound.radiation.transfer import Transfer
from sound.rendering.listening import Listening
from sound.rendering.solid import SoundingSolid, struck_amplitudes
from sound.scenes.audible.loudness import mode_directivity
from sound.scenes.bodies import bodies_of, with_modes
from sound.scenes.object_entry import ObjectEntry
from sound.shape import Shape
from studio.binary import unpack
from studio.processes.bank import Aim, Heard, bank
from tests import small_project
from tests.radiation_bem import CHECKED, RADIUS, sphere, sphere_pressure
from tests.small_design import small_design
from tests.test_sound_gradient import (
    EDGE,
    SIZE,
    differences,
    gradients,
    random_objective,
    relative,
    simulation,
)

AT = (0.5, 0.4, 0.9)
LISTEN = {"at": list(AT), "radiation": "sphere"}
DIRECTION = np.array([0.6, 0.0, -0.8])


def shape_of(surface: trimesh.Trimesh) -> Shape:
    return Shape.of_surface(np.asarray(surface.vertices), np.asarray(surface.faces), np.zeros(3))


def box_shape(sides) -> Shape:
    box = trimesh.creation.box(sides)
    return shape_of(box.subdivide().subdivide().subdivide())


def designed(design: Design) -> Design:
    """The design as one for the place."""
    design = replace(design, settings={**design.settings, "listen": LISTEN})
    heard = transfer_of(design).heard(design.model, design.elastic_modes, design.frequencies)
    return replace(design, heard=heard)


# Transfers ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("ka", CHECKED)
def test_a_sphere_is_heard_as_theory_has_it_in_every_direction(ka):
    vibrating = sphere(ka)
    shape = Shape.of_surface(vibrating.mesh.vertices, vibrating.mesh.faces, np.zeros(3))
    moved = vibrating.motion[shape.faces].mean(axis=1)
    for cosine in (1.0, 0.3, -0.9):
        direction = np.array([np.sqrt(1.0 - cosine**2), 0.0, cosine])
        surface = surface_points(shape)
        fields = sphere_fields(surface, direction, vibrating.frequencies)
        heard = (fields * np.einsum("fin,fi->nf", moved, surface.outward)).sum(axis=1)
        legendre = np.array([1.0, cosine, 1.5 * cosine**2 - 0.5])
        expected = [sphere_pressure(n, np.array(ka / RADIUS), RADIUS) for n in range(3)]
        assert np.abs(heard) == pytest.approx(np.abs(legendre) * expected, rel=0.03)


def test_the_directivity_with_all_phases_is_the_field_of_each_direction():
    shape = box_shape((0.2, 0.1, 0.06))
    rng = np.random.default_rng(5)
    motion, hertz = rng.normal(size=(len(shape.vertices), 3, 3)), np.array([400.0, 1500.0, 2500.0])
    surface = surface_points(shape)
    outward = np.einsum("fin,fi->nf", motion[shape.faces].mean(axis=1), surface.outward)
    expected = (sphere_fields(surface, DIRECTION, hertz) * outward).sum(axis=1)
    moved = motion[shape.faces].mean(axis=1)
    found = sphere_directivity(lambda _: moved, shape, hertz).towards(DIRECTION[None])[0]
    assert found == pytest.approx(1j * np.conj(expected), rel=1e-3)


def test_power_over_all_directions_is_that_of_monopole_and_dipole():
    shape = box_shape((0.2, 0.1, 0.06))
    hertz = np.array([500.0, 1000.0, 2000.0])
    x = shape.vertices / 0.1
    motion = np.stack([x, np.roll(x, 1, axis=1), x**2], axis=2)
    moved = motion[shape.faces].mean(axis=1)
    found = sphere_directivity(lambda _: moved, shape, hertz).rms
    assert found == pytest.approx(radiated(motion, shape, hertz).directivity.rms, rel=0.05)


def test_few_patterns_and_frequencies_are_near_the_fields_between():
    shape = box_shape((0.2, 0.1, 0.06))
    transfer = transfer_to(FarPlace(2.0 * DIRECTION), shape, np.zeros(3), (300.0, 4000.0), "box")
    assert transfer.patterns.shape[1] < 20
    hertz = np.array([301.0, 777.0, 1900.0, 3999.0])
    expected = sphere_fields(surface_points(shape), DIRECTION, hertz)
    found = transfer.at(hertz) @ transfer.patterns.T
    off = np.linalg.norm(found - expected, axis=1) / np.linalg.norm(expected, axis=1)
    assert (off < 0.012).all()
    step = 1e-4
    slopes = (transfer.at(hertz * (1 + step)) - transfer.at(hertz * (1 - step))) / (2 * step)
    assert transfer.slopes(hertz) == pytest.approx(slopes, rel=1e-5, abs=1e-9)
    ends = transfer.at(np.array([1.0, 1e5]))
    assert (
        ends == pytest.approx(transfer.coefficients[[0, -1]])
        and not transfer.slopes(np.array([1.0, 1e5])).any()
    )


def test_loads_push_modes_as_patterns_see_them():
    design = small_design()
    transfer = transfer_of(replace(design, settings={**design.settings, "listen": LISTEN}))
    solid = SoundingSolid.of_design(design)
    outward = np.einsum("pin,pi->pn", solid.motion(transfer.points), transfer.outward)
    expected = transfer.patterns.T @ outward
    found = transfer.loads(design.model).T @ design.elastic_modes
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-9 * np.abs(expected).max())


def test_more_frequencies_are_solved_where_the_air_resonates():
    solved: list[float] = []

    def solve(hertz):
        solved.extend(hertz)
        return (1.0 + 0.5 / (1.0 - (hertz / 1000.0) ** 2 + 0.1j))[:, None] * np.ones(3)

    first = np.geomspace(200.0, 5000.0, 14)
    hertz, values = adapted(solve, first)
    assert sorted(solved) == hertz.tolist() and len(values) == len(hertz)
    near = (hertz > 900.0) & (hertz < 1100.0)
    assert near.sum() > 10 and len(hertz) < 100
    between = np.geomspace(200.0, 5000.0, 500)
    truth = solve(between)
    off = np.abs(CubicSpline(hertz, values)(between) - truth) / np.abs(truth)
    assert off.max() < 2.0 * AGREED


def test_a_near_place_is_refused():
    shape = box_shape((0.2, 0.1, 0.06))
    with pytest.raises(
        UserError, match="listen.at: lies 0.2 m from the middle of the solid, expected"
    ):
        transfer_to(FarPlace(0.2 * DIRECTION), shape, np.zeros(3), (300.0, 4000.0), "box")


# Derivatives --------------------------------------------------------------------------------------


def heard_objective(shape, seed=0):
    """A random objective of a block, heard at a place."""
    base, sides = random_objective(seed), EDGE * np.array(shape)
    targets = replace(base.targets, frequencies=20.0 * base.targets.frequencies)
    place, hertz = FarPlace(sides / 2 + 3.0 * DIRECTION), targets.frequencies
    transfer = transfer_to(place, box_shape(sides), sides / 2, (hertz[0], hertz[-1]), "block")
    return Objective(targets, base.weights, heard=transfer), transfer


@pytest.mark.parametrize("coarsen", ["none", "galerkin"])
@pytest.mark.parametrize("size", [0.3, 0.01])
def test_gradient_of_what_is_heard(coarsen, size):
    """Of a cuboid, and of one that is nearly a cube, whose modes are hardly apart."""
    shape = (8, 6, 4) if size > 0.1 else (6, 6, 4)
    objective, transfer = heard_objective(shape)
    solid = simulation(shape, coarsen, "exponential", heard=transfer)
    z = size * np.random.default_rng(1).standard_normal(SIZE)
    frequency, amplitude, evaluation = gradients(solid, objective, z)
    by_frequency, by_amplitude = differences(solid, objective, z, 2e-6)
    assert relative(frequency, by_frequency) < 1e-4
    assert relative(amplitude, by_amplitude) < 1e-4
    whole = solid.differentiate(evaluation, whole=True)
    rows = objective.amplitude_jacobian(whole.eigenvalues, whole.pushed, whole.sensitivity)
    residual = objective.amplitude_residual(whole.eigenvalues, whole.pushed)
    assert relative(np.einsum("tnm,tn->m", rows, residual), by_amplitude) < 1e-4


def test_what_is_heard_does_not_depend_on_the_basis_of_equal_modes():
    rng = np.random.default_rng(2)
    transfer = Transfer(
        np.zeros((1, 3)),
        np.zeros((1, 3)),
        np.zeros((1, 3)),
        np.array([100.0, 1000.0]),
        rng.normal(size=(2, 3)) + 1j * rng.normal(size=(2, 3)),
    )
    eigenvalues = (2.0 * np.pi * np.array([200.0, 300.0, 300.0, 500.0])) ** 2
    hertz = np.sqrt(eigenvalues) / (2.0 * np.pi)
    pushed = rng.normal(size=(5, 4))
    turned = pushed.copy()
    turn = np.array([[np.cos(0.7), np.sin(0.7)], [-np.sin(0.7), np.cos(0.7)]])
    turned[:, 1:3] = pushed[:, 1:3] @ turn
    expected = heard_energies(eigenvalues, pushed, hertz, transfer)
    assert heard_energies(eigenvalues, turned, hertz, transfer) == pytest.approx(expected)
    amplitudes = []
    for each in (pushed, turned):
        heard = (transfer.at(hertz) * each[2:].T).sum(axis=1)
        amplitudes.append(struck_amplitudes(each[:2], hertz, heard))
    assert amplitudes[0][:, 1:3].sum(axis=1) == pytest.approx(amplitudes[1][:, 1:3].sum(axis=1))
    # Half of the pair's energy goes to each.
    assert 2.0 * expected[:, 1] == pytest.approx(amplitudes[0][:, 1:3].sum(axis=1) ** 2)
    assert expected[:, 0] == pytest.approx(amplitudes[0][:, 0] ** 2)


# Designs ------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def found(tmp_path_factory) -> Design:
    """A bar searched for what another one sounds like at the place."""
    folder = tmp_path_factory.mktemp("place")
    project = replace(
        small_project.project(folder), listen=project_of(listening_project(), folder).listen
    )
    targets = small_project.targets(project, names=("end", "side"))
    setting = prepare(project, targets).setting
    moduli = small_project.other_moduli(setting.mesh.grid)
    evaluation = setting.simulation().evaluate(setting.material.coordinates(moduli))
    balance = setting.objective.balance(evaluation.eigenvalues, evaluation.pushed)
    return optimise(prepare(project, replace(targets, amplitudes=balance)))


def listening_project(**changes):
    return {**small_project.PROJECT, "listen": LISTEN, **changes}


def test_a_search_comes_near_what_shall_be_heard(found):
    assert found.evidence["cost"] < 0.1 * found.evidence["cost_start"]
    transfer = transfer_of(found)
    expected = transfer.heard(found.model, found.elastic_modes, found.frequencies)
    # The search knew the band of its targets, which is nearly that of the design.
    assert np.abs(found.heard) == pytest.approx(np.abs(expected), rel=0.05)


def test_a_design_sounds_as_it_is_heard_and_its_file_keeps_that(found, tmp_path):
    write_design(tmp_path / "d.h5", found)
    read = read_design(tmp_path / "d.h5")
    assert np.array_equal(read.heard, found.heard)
    assert read.place.at == pytest.approx(AT) and not read.place.by_elements
    positions = np.array([strike.position for strike in found.strikes])
    inward = np.array([strike.inward for strike in found.strikes])
    solid = SoundingSolid.of_design(read)
    pushed = np.einsum("pik,pi->pk", solid.motion(positions), inward)
    amplitudes = solid.amplitudes(positions, inward)
    assert amplitudes == pytest.approx(np.abs(pushed * found.heard), rel=1e-9)
    model = ModalModel.of_design(read)
    ratio = model.amplitudes[: len(positions)] / amplitudes
    assert ratio == pytest.approx(np.repeat(ratio[:, :1], ratio.shape[1], axis=1))


def test_modes_of_the_design_in_another_file_are_heard_like_it():
    design = designed(small_design())
    values = design.eigenvalues
    hertz = frequencies(values)
    file = ModesFile(values, hertz, design.modes, 0.0 * values, design.model, {}, {})
    solid = SoundingSolid.of_truth(file, design)
    assert np.abs(solid.heard) == pytest.approx(np.abs(design.heard), rel=1e-6)


def test_a_design_of_other_pressures_is_no_design(tmp_path):
    design = designed(small_design())
    with pytest.raises(ValueError, match="pressures at the place where it is heard of shape"):
        write_design(tmp_path / "d.h5", replace(design, heard=design.heard[1:]))
    with pytest.raises(ValueError, match="no finite numbers"):
        write_design(tmp_path / "d.h5", replace(design, heard=np.nan * design.heard))
    settings = {**design.settings, "listen": {"at": [1.0, 2.0]}}
    with pytest.raises(ValueError, match="the setting listen"):
        write_design(tmp_path / "d.h5", replace(design, settings=settings))


def test_a_place_and_a_free_size_exclude_each_other(tmp_path):
    build = {"materials": ["aluminium", "steel"]}
    with pytest.raises(UserError, match="build.size: found free beside listen, expected mesh"):
        project_of(listening_project(build=build), tmp_path)
    project_of(listening_project(build={**build, "size": "mesh"}), tmp_path)


# Scenes -------------------------------------------------------------------------------------------


def test_in_scenes_a_design_sounds_as_designed_at_its_place_alone(found, tmp_path):
    write_design(tmp_path / "d.h5", found)
    entry = ObjectEntry(name="bar", design=str(tmp_path / "d.h5"))
    body = with_modes(bodies_of([entry]))[0]
    listening = Listening.of_design(found, SoundingSolid.of_design(found))
    assert not body.is_as_clips and np.array_equal(body.listening.gains, listening.gains)
    away = np.array(AT) - mass_properties(found.model).centre
    way = away[None] / np.linalg.norm(away)
    directivity = mode_directivity(body, True)
    there, elsewhere = (np.abs(directivity.towards(each))[0] for each in (way, -way))
    loudest = np.abs(found.heard).max()
    assert there == pytest.approx(np.abs(found.heard), rel=0.05, abs=0.02 * loudest)
    assert np.abs(20.0 * np.log10(elsewhere / there)).max() > 1.0
    assert mode_directivity(body, False).rms == pytest.approx(np.abs(found.heard))


# The studio ---------------------------------------------------------------------------------------


def test_the_studio_plays_what_is_heard_at_the_place(found):
    solid = SoundingSolid.of_design(found)
    listening = Listening.of_design(found, solid)
    vertices = np.array([strike.vertex for strike in found.strikes])
    positions = found.surface_vertices
    inward = inward_normals(
        trimesh.Trimesh(positions, found.surface_faces, process=False), positions
    )
    pushed = np.einsum("pik,pi->pk", solid.motion(positions), inward)
    heard = Heard(
        found.frequencies, found.dampings, pushed, np.ones(len(positions)), at_place=found.heard
    )
    _, arrays = unpack(bank(heard, positions, Aim(found.targets, vertices), {}))
    expected = solid.amplitudes(positions[vertices], inward[vertices])
    expected *= np.array([listening.gain(positions[vertex]) for vertex in vertices])[:, None]
    assert arrays["struck"] == pytest.approx(expected, rel=1e-6)
