"""Motion and sound of a struck solid: against time integration of K and M, and laws that hold."""

import json
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as la

from carillon.errors import UserError
from carillon.fem.embedding import embedding
from carillon.fem.geometry import blocks_from_mesh, hexmesh_from_grid, prolongation
from carillon.fem.model import RIGID_MODES, ElasticModel, fine_model
from solver.__main__ import main
from solver.assembly.sparse import assembled
from solver.coarsening.model import coarse_model
from solver.files.modes_file import ModesFile, frequencies, read_modes, write_modes
from solver.response.contact import Contact, choose_contacts
from solver.response.points import interpolation
from solver.response.response import (
    SAMPLE_RATE_HERTZ,
    Contacts,
    Damping,
    at_contacts,
    contact_sounds,
    displacements,
    impulse_responses,
    in_turn,
    relative_difference,
    spectral_distance,
    spectrogram,
)
from solver.response.response_file import StrikeOptions, read_response, respond, write_response
from solver.response.surface import surface_normals, surface_of
from solver.verification.audit import audit
from tests import cut_solids, solids
from tests.edited_files import edited
from tests.solids import box_mesh, random_box

DAMPING = Damping(40.0, 2e-6)


def all_modes(model: ElasticModel, count: int | None = None) -> ModesFile:
    """What a modes file of this model would hold, from LAPACK."""
    K, M = (part.toarray() for part in assembled(model))
    values, modes = la.eigh(K, M)
    values[:RIGID_MODES] = 0.0
    values, modes = values[:count], modes[:, :count]
    return ModesFile(values, frequencies(values), modes, np.zeros(len(values)), model, {}, {})


@pytest.fixture(scope="module")
def bar() -> ModesFile:
    return all_modes(random_box(4, 2, 1))


@pytest.fixture(scope="module")
def contacts(bar) -> list[Contact]:
    return choose_contacts(bar)


def integrated(file: ModesFile, contacts: list[Contact], seconds: np.ndarray) -> np.ndarray:
    """Displacement of the second point after an impulse at the first, by the matrix exponential.

    The equations of motion M u'' + C u' + K u = 0 as one system of first order; the impulse gives
    the velocity M^-1 f, from which the rigid motion is taken with the momenta alone.
    """
    K, M = (part.toarray() for part in assembled(file.model))
    values = interpolation(
        file.model, np.array([contact.position for contact in contacts])
    ).toarray()
    force = np.outer(values[0], contacts[0].inward).ravel()
    rigid = la.null_space(K, rcond=1e-10)
    velocity = np.linalg.solve(M, force)
    velocity -= rigid @ np.linalg.solve(rigid.T @ M @ rigid, rigid.T @ force)
    C = DAMPING.mass_per_second * M + DAMPING.stiffness_seconds * K
    size = len(K)
    system = np.block(
        [[np.zeros((size, size)), np.eye(size)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]]
    )
    step = la.expm(system * (seconds[1] - seconds[0]))
    state = np.concatenate([np.zeros(size), velocity])
    found = np.empty((len(seconds), 3))
    for index in range(len(seconds)):
        found[index] = values[1] @ state[:size].reshape(-1, 3)
        state = step @ state
    return found


def test_superposition_of_all_modes_is_the_solution_of_the_equations_of_motion(bar, contacts):
    seconds = np.linspace(0.0, 3.0 / bar.frequencies[RIGID_MODES], 40)
    found = displacements(at_contacts(bar, contacts), DAMPING, seconds)
    expected = integrated(bar, contacts, seconds)
    assert relative_difference(found, expected) < 1e-7
    assert np.abs(expected).max() > 0.0


def test_struck_here_and_watched_there_is_the_same_the_other_way_round(bar, contacts):
    seconds = np.linspace(0.0, 2.0 / bar.frequencies[RIGID_MODES], 50)
    seen = at_contacts(bar, contacts)
    there = displacements(seen, DAMPING, seconds, 0, 2) @ contacts[2].inward
    back = displacements(seen, DAMPING, seconds, 2, 0) @ contacts[0].inward
    np.testing.assert_allclose(there, back, atol=1e-12 * np.abs(there).max())


def test_energy_only_falls_and_without_damping_stays():
    eigenvalues = np.array([1e6, 4e6, 3e7])
    seconds = np.linspace(0.0, 0.02, 4001)
    for damping in (Damping(0.0, 0.0), Damping(30.0, 1e-6)):
        position = impulse_responses(eigenvalues, damping, seconds)
        # Central differences; ends are left out.
        velocity = np.gradient(position, seconds, axis=0)[1:-1]
        energy = (0.5 * velocity**2 + 0.5 * eigenvalues * position[1:-1] ** 2).sum(axis=1)
        if damping.mass_per_second:
            coarse = energy[::100]
            assert np.all(np.diff(coarse) < 0.0) and coarse[-1] < 0.6 * coarse[0]
        else:
            np.testing.assert_allclose(energy, 1.5, rtol=2e-3)


def test_a_stiffer_solid_does_the_same_sooner_and_less(bar, contacts):
    """K scaled by s: frequencies grow by sqrt(s), displacements shrink by it (undamped)."""
    stiffer = all_modes(bar.model.with_young(4.0 * bar.model.young))
    seconds = np.linspace(0.0, 2.0 / bar.frequencies[RIGID_MODES], 60)
    undamped = Damping(0.0, 0.0)
    slow = displacements(at_contacts(bar, contacts), undamped, seconds)
    fast = displacements(at_contacts(stiffer, contacts), undamped, seconds / 2.0)
    assert relative_difference(2.0 * fast, slow) < 1e-7


def test_a_mode_that_hardly_oscillates_is_continued_through_critical_damping():
    seconds = np.linspace(0.0, 2.0, 30)
    below, at, above = (
        impulse_responses(np.array([1.0]), Damping(2.0 * decay, 0.0), seconds)[:, 0]
        for decay in (1.0 - 1e-7, 1.0, 1.0 + 1e-7)
    )
    np.testing.assert_allclose(at, seconds * np.exp(-seconds), rtol=1e-12)
    np.testing.assert_allclose(below, at, atol=1e-5)
    np.testing.assert_allclose(above, at, atol=1e-5)
    slow = impulse_responses(np.array([1.0]), Damping(2000.0, 0.0), np.array([0.0, 1e3, 1e9]))
    assert np.isfinite(slow).all() and slow[1, 0] == pytest.approx(np.exp(-0.5) / 2000.0, rel=1e-3)


def test_interpolation_is_exact_for_trilinear_fields_and_agrees_with_the_prolongation():
    blocks = blocks_from_mesh(box_mesh(5, 4, 3))
    fine = fine_model(blocks.fine, np.ones(blocks.fine.n_cells))
    coarse = coarse_model(blocks, np.ones((blocks.coarse.n_cells, 8)))
    weights = np.random.default_rng(1).standard_normal(8)

    def field(points):
        x, y, z = (points / 0.01).T
        return np.stack([x**0, x, y, z, x * y, y * z, x * z, x * y * z], axis=1) @ weights

    points = np.random.default_rng(2).uniform(0.0, 0.03, (50, 3))
    for model in (fine, coarse):
        np.testing.assert_allclose(
            interpolation(model, points) @ field(model.mesh.nodes), field(points)
        )
    assert abs(interpolation(coarse, blocks.fine.nodes) - prolongation(blocks)).max() < 1e-12


def test_points_near_parts_of_a_block_belong_to_the_part():
    """Two columns in opposite corners of one row of blocks, on a plate that joins them."""
    columns = [(0, 0, z) for z in (2, 3)] + [(1, 1, z) for z in (2, 3)]
    plate = [(x, y, z) for x in range(2) for y in range(2) for z in range(2)]
    blocks = blocks_from_mesh(hexmesh_from_grid(np.array(plate + columns), np.zeros(3), 1.0))
    model = coarse_model(blocks, np.ones((blocks.coarse.n_cells, 8)))
    cells, weights = embedding(model, np.array([[0.2, 0.9, 3.0], [1.8, 1.1, 3.0], [1.0, 1.0, 0.5]]))
    first, second = np.flatnonzero(model.mesh.grid[:, 2] == 1)
    assert cells.tolist() == [first, second, 0]
    np.testing.assert_allclose(weights.sum(axis=1), 1.0)


def test_normals_of_a_box_point_outwards():
    mesh = box_mesh(12, 12, 12)
    nodes, outward = surface_normals(mesh)
    points = mesh.nodes[nodes]
    assert len(nodes) == 13**3 - 11**3
    np.testing.assert_allclose(np.linalg.norm(outward, axis=1), 1.0)
    assert (np.einsum("ni,ni->n", outward, points - points.mean(axis=0)) > 0.0).all()
    middle = np.flatnonzero(np.isclose(points, [0.06, 0.06, 0.0]).all(axis=1))
    np.testing.assert_allclose(outward[middle], [[0.0, 0.0, -1.0]], atol=1e-12)


def test_points_are_far_apart_and_a_person_may_choose_others(bar, contacts):
    positions = np.array([contact.position for contact in contacts])
    assert min(np.linalg.norm(positions[0] - other) for other in positions[1:]) > 0.01
    again = choose_contacts(bar, strike=[0.0401, 0.02, 0.0], observed=[0.0, 0.0, 0.0099])
    np.testing.assert_allclose(again[0].position, [0.04, 0.02, 0.0], atol=1e-12)
    np.testing.assert_allclose(again[1].position, [0.0, 0.0, 0.01], atol=1e-12)
    with pytest.raises(UserError, match=r"strike: the point \(1, 0, 0\) m is .* from the surface"):
        choose_contacts(bar, strike=[1.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def tilted():
    """A box that stands askew in its lattice, and modes of its finite cells."""
    surface = cut_solids.turned(cut_solids.box(0.2, 0.12, 0.03))
    model = cut_solids.uniform(cut_solids.spaced(surface, 0.02))
    found = solids.analysed(model, modes=12, method="slepc")
    values, block = found.values, found.system.gather(found.vectors)
    return surface, ModesFile(values, frequencies(values), block, found.residuals, model, {}, {})


def test_finite_cells_are_struck_on_the_surface_itself(tilted):
    surface, file = tilted
    contacts = choose_contacts(file)
    points = np.array([contact.position for contact in contacts])
    nearest, distance, faces = surface.nearest.on_surface(points)
    assert distance.max() < 0.15 * file.mesh.edge
    inward = np.array([contact.inward for contact in contacts])
    assert min(np.einsum("pi,pi->p", inward, -surface.face_normals[faces])) > 0.5
    all_of_it = surface_of(file.model).points
    assert np.quantile(surface.nearest.on_surface(all_of_it)[1], 0.95) < 0.2 * file.mesh.edge


def test_a_place_outside_finite_cells_is_taken_to_the_nearest_inside(tilted, caplog):
    surface, file = tilted
    largest = surface.area_faces > 0.99 * surface.area_faces.max()
    assert largest.sum() == 4
    for middle, normal in zip(surface.triangles_center[largest], surface.face_normals[largest]):
        caplog.clear()
        np.testing.assert_array_equal(choose_contacts(file, strike=middle)[0].position, middle)
        assert caplog.messages == []
        outside = choose_contacts(file, strike=middle + 0.02 * normal)[0]
        assert np.linalg.norm(outside.position - middle) < 0.2 * file.mesh.edge
        assert outside.inward @ normal < -0.99
        (said,) = caplog.messages
        assert "strike: the point" in said and " off the surface" in said
        with pytest.raises(UserError, match="from the surface of the solid"):
            choose_contacts(file, strike=middle + 0.1 * normal)


def one_mode(hertz: float) -> Contacts:
    return Contacts(
        np.array([(2.0 * np.pi * hertz) ** 2]), np.array([[[1.0], [0.0], [0.0]]]), np.array([[2.0]])
    )


def test_a_single_mode_sounds_at_its_frequency_and_dies_at_its_rate():
    damping = Damping(40.0, 0.0)
    sound = contact_sounds(one_mode(1000.0), damping, 1.0 / SAMPLE_RATE_HERTZ)[0]
    seconds = np.arange(len(sound)) / SAMPLE_RATE_HERTZ
    expected = (
        4.0 * np.exp(-20.0 * seconds) * np.sin(np.sqrt((2e3 * np.pi) ** 2 - 20.0**2) * seconds)
    )
    np.testing.assert_allclose(sound, expected, atol=1e-9)
    times, hertz, magnitudes = spectrogram(sound)
    assert abs(hertz[magnitudes.max(axis=1).argmax()] - 1000.0) < 25.0
    early, late = (np.argmin(abs(times - at)) for at in (0.1, 0.2))
    ratio = magnitudes[:, late].max() / magnitudes[:, early].max()
    assert ratio == pytest.approx(np.exp(-20.0 * 0.1), rel=0.02)


def test_what_nobody_hears_is_silent_and_a_longer_contact_is_duller():
    assert not contact_sounds(one_mode(5.0), DAMPING, 1e-4).any()
    assert not contact_sounds(one_mode(30_000.0), DAMPING, 1e-4).any()
    hard, soft = (np.abs(contact_sounds(one_mode(4000.0), DAMPING, t)).max() for t in (1e-4, 1e-3))
    assert soft < 0.5 * hard


def test_sounds_do_not_depend_on_the_signs_of_modes_nor_on_a_turn_in_a_cluster():
    generator = np.random.default_rng(4)
    values = np.array([1e7, 1e7, 5e7])
    push = generator.standard_normal((3, 3))
    turn = la.block_diag([[0.6, -0.8], [0.8, 0.6]], -1.0)
    sounds = [
        contact_sounds(Contacts(values, np.zeros((3, 3, 3)), part), DAMPING, 1e-4)
        for part in (push, push @ turn)
    ]
    assert relative_difference(*sounds) < 1e-12
    one, other = (in_turn(part, np.abs(sounds[0]).max(axis=1)) for part in sounds)
    assert spectral_distance(other, one) < 1e-6
    assert spectral_distance(0.5 * one, one) > 3.0


def test_every_strike_is_played_as_loud_as_the_truths_and_silence_stays_silent():
    played = in_turn(np.array([[4.0, -8.0], [0.0, 0.0], [0.1, 0.2]]), np.array([8.0, 0.0, 0.2]))
    np.testing.assert_allclose(played, [0.5, -1.0, 0.0, 0.0, 0.5, 1.0])


@pytest.fixture
def files(tmp_path, bar):
    """Modes files of a truth, of the same with a mode left out, and of a coarsening."""

    def write(name: str, model: ElasticModel, values: np.ndarray, modes: np.ndarray):
        write_modes(tmp_path / name, model, values, [modes], np.zeros(len(values)), {}, {})
        return tmp_path / name

    blocks = blocks_from_mesh(bar.mesh)
    pattern = np.packbits(blocks.mask, axis=1, bitorder="little").ravel()
    coarse = all_modes(
        ElasticModel(blocks.coarse, np.full((blocks.coarse.n_cells, 8), 1e9), pattern), 20
    )
    kept = np.delete(np.arange(31), 8)
    return {
        "truth": write("truth.h5", bar.model, bar.eigenvalues[:30], bar.modes[:, :30]),
        "lost": write("lost.h5", bar.model, bar.eigenvalues[kept], bar.modes[:, kept]),
        "coarse": write("coarse.h5", coarse.model, coarse.eigenvalues, coarse.modes),
    }


def test_response_file_holds_what_was_found(tmp_path, files):
    candidates = {name: files[name] for name in ("lost", "coarse")}
    found = respond(files["truth"], candidates, StrikeOptions(periods=3.0))
    assert list(found.responses) == ["truth", "lost", "coarse"]
    assert found.responses["truth"].difference == 0.0
    # A missing mode is missed, and a coarsened mesh is watched at the same point.
    assert found.responses["lost"].difference > 0.05
    assert 0.05 < found.responses["coarse"].difference < 3.0
    write_response(tmp_path / "response.h5", found, {"why": "a test"})
    read = read_response(tmp_path / "response.h5")
    np.testing.assert_array_equal(read.seconds, found.seconds)
    for name, response in found.responses.items():
        np.testing.assert_array_equal(read.responses[name].displacement, response.displacement)
        assert read.responses[name].difference == response.difference
    assert read.attributes["mass_damping"] == 30.0 and read.provenance["commit"]
    with pytest.raises(UserError, match="holds 'response', expected a Carillon modes file"):
        read_modes(tmp_path / "response.h5")


def test_an_audit_finds_a_missing_mode_and_a_wrong_one(tmp_path, files):
    good, lost = (audit(read_modes(files[name])) for name in ("truth", "lost"))
    assert good.counted == good.expected > 20 and good.rigid_modes == RIGID_MODES
    assert good.residual_max < 1e-6 and good.orthogonality < 1e-8
    assert lost.counted == lost.expected + 1
    with edited(files["truth"]) as file:
        file["eigenvalues"][10] *= 1.01
    assert audit(read_modes(files["truth"])).residual_max > 1e-3


def test_commands_read_and_write_files(tmp_path, files, capsys):
    given = [str(files[name]) for name in ("truth", "coarse")]
    out = str(tmp_path / "audit.json")
    assert main(["audit", *given, "--out", out]) == 0
    assert "truth: 30 modes of 90 unknowns, 6 rigid" in capsys.readouterr().out
    assert set(json.loads(Path(out).read_text())["spectra"]) == {"truth", "coarse"}
    out = str(tmp_path / "response.h5")
    assert main(["respond", *given, "--strike", "-0.001", "0", "0", "--out", out]) == 0
    np.testing.assert_allclose(read_response(out).contacts["strike"].position, 0.0, atol=1e-12)
    assert main(["respond", *given, "--strike", "1", "0", "0", "--out", out]) == 2
    assert "from the surface of the voxels" in capsys.readouterr().err
