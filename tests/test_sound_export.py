"""What other tools read from an exported design."""

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
import trimesh

from carillon.fem.geometry.walls import WallSize
from carillon.fem.materials import young_modulus
from carillon.fem.model import fine_model, mass_properties
from carillon.fem.regions import Regions
from carillon.parameters.quantities import UP_AXES
from solver.coarsening.choice import make_coarsening
from solver.coarsening.model import build_model
from solver.files.modes_file import read_modes
from solver.response.points import interpolation
from solver.verification.audit import audit
from solver.verification.comparison import compare_files
from sound.__main__ import main
from sound.export.embedded import write_embedded
from sound.export.gltf import EXTENSION, PHYSICS, write_gltf
from sound.export.gltf_surface import colours_of, shaded
from sound.project.design_file import write_design
from sound.rendering.listening import Listening
from sound.rendering.render import Hit, render
from sound.rendering.solid import SoundingSolid
from sound.scenes.bodies import bodies_of
from sound.synthesis.sinusoids import Bank, ring
from tests.gltf_files import accessor, read_gltf, rms, sound_of, validated
from tests.programs import run
from tests.scenes import scene
from tests.small_design import N_MODES, SIDES, small_design
from tests.solids import box_mesh

RATE = 44_100
PLAYER = """
#include <cstdio>
#include <cstdlib>
#include <map>
#include <string>
#define FAUSTFLOAT double
struct Meta { void declare(const char*, const char*) {} };
struct UI {
    std::map<std::string, double*> zones;
    void openVerticalBox(const char*) {}
    void openHorizontalBox(const char*) {}
    void closeBox() {}
    void declare(double*, const char*, const char*) {}
    void addButton(const char* name, double* zone) { zones[name] = zone; }
    void addNumEntry(const char* name, double* zone, double, double, double, double)
    { zones[name] = zone; }
    void addHorizontalSlider(const char* name, double* zone, double, double, double, double)
    { zones[name] = zone; }
};
struct dsp {};
<<includeIntrinsic>>
<<includeclass>>
int main(int, char** words) {
    mydsp model;
    UI ui;
    model.init(44100);
    model.buildUserInterface(&ui);
    *ui.zones["position"] = atof(words[1]);
    *ui.zones["impulse"] = atof(words[2]);
    *ui.zones["contact"] = atof(words[3]);
    *ui.zones["gate"] = 1.0;
    static double sound[22050];
    double* outputs[] = {sound};
    model.compute(22050, nullptr, outputs);
    fwrite(sound, sizeof(double), 22050, stdout);
}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """The design and all its exports."""
    path = tmp_path_factory.mktemp("export")
    write_design(path / "design.h5", small_design())
    for name in ("pan.h5", "pan.gltf", "pan.glb"):
        assert main(["export", str(path / "design.h5"), "--out", str(path / name)]) == 0
    points = ["--points", "3", "--out", str(path / "pan.dsp")]
    assert main(["export", str(path / "design.h5"), *points]) == 0
    return path


def target_amplitudes() -> np.ndarray:
    """Amplitudes (T, N) in full scale after 1 N s at the targets' points."""
    design = small_design()
    solid = SoundingSolid.of_design(design)
    inward = np.array([strike.inward for strike in design.strikes])
    listening = Listening.of_design(design, solid)
    return listening.gains[:, None] * solid.amplitudes(listening.positions, inward)


def test_the_solver_reads_and_audits_the_embedded_mesh(folder):
    file = read_modes(folder / "pan.h5")
    np.testing.assert_array_equal(file.modes, small_design().modes)
    row = audit(file)
    assert row.rigid_modes == 6 and row.counted == row.expected
    assert row.residual_max < 1e-9 and row.orthogonality < 1e-9
    compared = compare_files(folder / "pan.h5", folder / "pan.h5")
    assert compared.modes_compared == N_MODES and compared.subspace_angle_max < 1e-7


def test_the_embedding_carries_modes_to_the_surface(folder):
    design = small_design()
    modes = design.modes.reshape(design.model.mesh.n_nodes, 3, -1)
    with h5py.File(folder / "pan.h5") as file:
        cells = file["cells"][()][file["surface/cell"][()]]
        motion = np.einsum("vc,vcik->vik", file["surface/weights"][()], modes[cells])
        np.testing.assert_array_equal(file["surface/vertices"], design.surface_vertices)
        np.testing.assert_array_equal(file["dampings"], design.targets.dampings)
        assert "kg" in file.attrs["normalisation"]
    values = interpolation(design.model, design.surface_vertices)
    expected = (values @ modes.reshape(len(modes), -1)).reshape(motion.shape)
    np.testing.assert_allclose(motion, expected, atol=1e-12)


@pytest.mark.parametrize("name", ["pan.gltf", "pan.glb"])
def test_gltf_is_the_surface(folder, name):
    loaded = trimesh.load(folder / name).to_geometry()
    # Vertices on edges are there once for each face.
    loaded.merge_vertices(merge_norm=True)
    assert loaded.is_watertight
    assert loaded.volume == pytest.approx(np.prod(SIDES), rel=1e-6)
    x, y, z = SIDES  # z points up
    np.testing.assert_allclose(loaded.bounds, [[0, 0, -y], [x, z, 0]], atol=1e-7)


@pytest.mark.parametrize("up", UP_AXES)
def test_the_axis_that_points_up_becomes_y(folder, tmp_path, up):
    words = [f"--up={up}", "--out", str(tmp_path / "pan.glb")]
    assert main(["export", str(folder / "design.h5"), *words]) == 0
    loaded = trimesh.load(tmp_path / "pan.glb").to_geometry()
    height = SIDES["xyz".index(up[-1])]
    # The box begins at the origin of its own axes.
    heights = [-height, 0.0] if up.startswith("-") else [0.0, height]
    assert loaded.bounds[:, 1] == pytest.approx(heights, abs=1e-7)
    assert loaded.volume == pytest.approx(np.prod(SIDES), rel=1e-6)


@pytest.mark.parametrize(
    "settings, up, height",
    [
        ({"mesh": "pan.glb"}, None, 1),
        ({"mesh": "pan.glb", "up": "y"}, None, 2),  # was turned: z of the solid was y of the file
        ({"mesh": "pan.glb", "up": "y"}, "y", 2),
        ({"mesh": "pan.glb", "up": "y"}, "z", 1),  # z of the file became -y of the solid
        ({"mesh": "pan.obj", "up": "x"}, None, 2),
    ],
)
def test_a_design_of_a_turned_mesh_is_not_turned_again(tmp_path, settings, up, height):
    design = small_design()
    design = replace(design, settings={**design.settings, "up": None, **settings})
    write_gltf(tmp_path / "pan.glb", design, True, up)
    loaded = trimesh.load(tmp_path / "pan.glb").to_geometry()
    assert np.ptp(loaded.bounds, axis=0)[1] == pytest.approx(SIDES[height])
    write_embedded(tmp_path / "pan.h5", design, {})
    assert read_modes(tmp_path / "pan.h5").up == settings.get("up")
    write_design(tmp_path / "design.h5", design)
    for file in ({"design": "design.h5"}, {"modes": "pan.h5"}):
        path = {key: str(tmp_path / name) for key, name in file.items()}
        (body,) = bodies_of(scene({"name": "pan", "up": up, **path}).objects)
        assert np.ptp(body.shape.vertices, axis=0)[2] == pytest.approx(SIDES[height])


@pytest.mark.parametrize(
    ("settings", "wall"),
    [
        ({}, None),
        ({"wall": None, "wall_side": "inside"}, None),
        ({"wall": 0.002, "wall_side": "outside"}, WallSize(0.002, "outside")),
    ],
)
def test_a_modes_file_of_a_design_names_its_wall(tmp_path, settings, wall):
    design = small_design()
    write_embedded(
        tmp_path / "pan.h5", replace(design, settings={**design.settings, **settings}), {}
    )
    assert read_modes(tmp_path / "pan.h5").wall == wall


def test_gltf_has_normals_and_the_material_as_colours(folder):
    document, data = read_gltf(folder / "pan.glb")
    ((surface,),) = (mesh["primitives"] for mesh in document["meshes"])
    positions, normals, colours = (
        accessor(document, data, surface["attributes"][name])
        for name in ("POSITION", "NORMAL", "COLOR_0")
    )
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-6)
    # Those of a box stand upright on its faces, and point away from its middle.
    assert np.abs(normals).max(axis=1).min() > 1.0 - 1e-6
    assert (((positions - np.array(SIDES) / 2) * normals).sum(axis=1) > 0.0).all()
    design = small_design()
    vertices, _, _ = shaded(design.surface_vertices, design.surface_faces)
    np.testing.assert_allclose(positions, vertices, atol=1e-7)
    np.testing.assert_allclose(colours, colours_of(design.young_near(vertices)), atol=1e-6)
    assert document["meshes"][0]["primitives"][0]["material"] < len(document["materials"])


@pytest.mark.parametrize("inverted", [False, True])
def test_normals_point_out_of_the_solid_and_into_cavities(inverted):
    outer, cavity = trimesh.creation.icosphere(radius=0.2), trimesh.creation.icosphere(radius=0.1)
    cavity.invert()
    surface = trimesh.util.concatenate([outer, cavity])
    if inverted:
        surface.invert()
    vertices, faces, normals = shaded(surface.vertices, surface.faces)
    outwards = (vertices * normals).sum(axis=1) > 0.0
    np.testing.assert_array_equal(outwards, np.linalg.norm(vertices, axis=1) > 0.15)
    assert len(faces) == len(surface.faces)


def test_stiffer_is_lighter():
    colours = colours_of(np.geomspace(1e9, 1e11, 101))
    assert (np.diff(colours[:, :3] @ (0.2126, 0.7152, 0.0722)) > 0.0).all()
    assert len(np.unique(colours_of(np.full(3, 2e9)), axis=0)) == 1


def test_gltf_has_the_mass_and_the_sounds_of_strikes(folder):
    document, data = read_gltf(folder / "pan.glb")
    physics = document["nodes"][0]["extensions"][PHYSICS]
    properties = mass_properties(small_design().model)
    assert physics["motion"]["mass"] == pytest.approx(properties.mass)
    assert physics["collider"]["geometry"]["node"] == 0
    sounds = document["extensions"]["KHR_audio_emitter"]
    for node, strike in zip(document["nodes"][1:], small_design().strikes, strict=True):
        (number,) = node["extensions"]["KHR_audio_emitter"]["emitters"]
        emitter = sounds["emitters"][number]
        assert emitter["type"] == "positional" and node["name"] == strike.name
        source = sounds["sources"][emitter["sources"][0]]
        samples, rate = sound_of(document, data, sounds["audio"][source["audio"]])
        assert rate == 48_000 and "autoplay" not in source
        solid = SoundingSolid.of_design(small_design())
        listening = Listening.of_design(small_design(), solid)
        hit = Hit(0.0, strike.position, strike.inward)
        truth = render(solid, [hit], len(samples) / rate, rate, listening=listening)
        assert 20.0 * np.log10(rms(source["gain"] * samples - truth) / rms(truth)) < -25.0


@pytest.mark.parametrize("name", ["pan.gltf", "pan.glb"])
def test_a_player_of_the_draft_makes_the_designed_sound(folder, name):
    document, data = read_gltf(folder / name)
    assert document["extensionsUsed"] == [EXTENSION, PHYSICS, "KHR_audio_emitter"]
    model = document["extensions"][EXTENSION]["modalModels"][0]
    f, d = (accessor(document, data, model[key])[:, 0] for key in ("frequencies", "decayRates"))
    positions = accessor(document, data, model["positions"])
    shapes = accessor(document, data, model["shapes"]).reshape(len(f), len(positions), 3)
    assert accessor(document, data, model["indices"]).max() < len(positions)
    order = np.array(model["extras"]["modeNumbers"]) - 1
    np.testing.assert_allclose(f, small_design().frequencies[order], rtol=1e-6)
    np.testing.assert_allclose(d, small_design().targets.dampings[order], rtol=1e-6)
    gain = document["nodes"][0]["extensions"][EXTENSION]["gain"]
    listening = [node["extras"]["gain"] for node in document["nodes"][1:]]
    for row, strike in enumerate(small_design().strikes):
        nearest = np.argmin(np.linalg.norm(positions - strike.position, axis=1))
        played = gain * 2 * np.pi * f * (shapes[:, nearest] @ strike.inward)
        own = np.abs(played) * listening[row] / np.mean(listening)
        np.testing.assert_allclose(own, target_amplitudes()[row, order], rtol=1e-4)


@pytest.mark.parametrize("name", ["pan.gltf", "pan.glb"])
def test_khronos_validator_finds_nothing_wrong(folder, name):
    validated(folder / name)


def test_the_loudest_modes_come_first(folder):
    document, _ = read_gltf(folder / "pan.glb")
    order = np.array(document["extensions"][EXTENSION]["modalModels"][0]["extras"]["modeNumbers"])
    energy = (target_amplitudes() ** 2).sum(axis=0) / small_design().targets.dampings
    assert (np.diff(energy[order - 1]) <= 0.0).all()


def test_mass_properties_of_a_box():
    a, b, c = SIDES
    properties = mass_properties(
        fine_model(box_mesh(6, 4, 2, 0.04), np.full(48, 1e9), regions=Regions.one(density=500.0))
    )
    mass = 500.0 * a * b * c
    assert properties.mass == pytest.approx(mass)
    np.testing.assert_allclose(properties.centre, np.array(SIDES) / 2)
    moments = mass / 12.0 * np.array([b**2 + c**2, a**2 + c**2, a**2 + b**2])
    np.testing.assert_allclose(properties.moments, np.sort(moments))
    assert np.linalg.det(properties.axes) == pytest.approx(1.0)


def test_partly_filled_coarse_cells_weigh_what_their_fine_ones_do():
    mesh = box_mesh(5, 3, 3, 0.02)
    young = np.full(mesh.n_cells, 1e9)
    coarse, fine = (
        mass_properties(build_model(mesh, young, make_coarsening(method)))
        for method in ("average", "none")
    )
    assert coarse.mass == pytest.approx(fine.mass)
    np.testing.assert_allclose(coarse.centre, fine.centre)
    np.testing.assert_allclose(coarse.moments, fine.moments)


@pytest.fixture(scope="module")
def player(folder) -> Path:
    """The Faust model as a program that writes the sound of a strike."""
    for tool in ("faust", "g++"):
        if shutil.which(tool) is None:
            pytest.skip(f"{tool} is not installed")
    (folder / "player.cpp").write_text(PLAYER)
    faust = ["faust", "-double", "-a", "player.cpp", "pan.dsp", "-o", "pan.cpp"]
    for words in (faust, ["g++", "-O1", "pan.cpp", "-o", "pan"]):
        run(*words, cwd=folder, check=True)
    return folder / "pan"


def played(player: Path, *words: float) -> np.ndarray:
    done = subprocess.run([player, *map(str, words)], capture_output=True, check=True)
    return np.frombuffer(done.stdout)


@pytest.mark.parametrize("position", [0, 1])
def test_faust_plays_what_we_render(player, position):
    design = small_design()
    bank = Bank(design.frequencies, design.targets.dampings, RATE)
    expected = ring(bank, [(0.0, 2.0 * target_amplitudes()[position])], 22_050)
    samples = played(player, position, 2.0, 0.0)
    np.testing.assert_allclose(samples, expected, atol=1e-6 * np.abs(expected).max())


def test_a_force_that_takes_time_has_the_same_impulse_in_faust(player):
    from solver.response.response import half_sine

    impulse, push = (played(player, 4, 1.0, contact) for contact in (0.0, 2.0))
    expected = np.convolve(impulse, half_sine(2e-3, RATE))[: len(impulse)]
    np.testing.assert_allclose(push, expected, atol=1e-6 * np.abs(impulse).max())


def test_faust_s_program_names_points_and_units(folder):
    text = (folder / "pan.dsp").read_text()
    assert 'declare name "design";' in text  # of the design, not of the file
    assert "nPositions = 5;" in text and f"nModes = {N_MODES};" in text
    assert "'corner':0;'side':1;'vertex_" in text
    assert "N s" in text and "kg^-1/2" in text


def test_moduli_are_those_of_the_solver_s_cells_in_their_order(folder, tmp_path):
    out = tmp_path / "young.npy"
    assert main(["export", str(folder / "design.h5"), "--out", str(out)]) == 0
    design, cells = small_design(), box_mesh(6, 4, 2, 0.04)
    np.testing.assert_array_equal(design.fine_grid, cells.grid)
    np.testing.assert_array_equal(young_modulus(str(out), cells), design.young)


def test_no_more_points_are_struck_than_there_are(folder):
    points = ["--points", "10000", "--out", str(folder / "all.dsp")]
    assert main(["export", str(folder / "design.h5"), *points]) == 0
    count = len(np.unique(np.round(small_design().surface_vertices, 9), axis=0))
    assert f"nPositions = {count};" in (folder / "all.dsp").read_text()


def test_an_ending_that_tells_no_format_is_refused(folder, refuses):
    design = folder / "design.h5"
    said = refuses(main, "export", design, "--out", folder / "pan.obj")
    assert "tells no format" in said
    said = refuses(main, "export", design, "--out", "pan.h5", "--format", "glb")
    assert "ends in .h5, but --format is glb" in said
    words = ["--out", str(folder / "pan.txt"), "--format", "dsp"]
    assert main(["export", str(folder / "design.h5"), *words]) == 0


def test_a_design_is_not_overwritten(folder, refuses):
    said = refuses(main, "export", folder / "design.h5", "--out", folder / "design.h5")
    assert "is an input and would be replaced" in said


def test_only_designs_are_exported(folder, refuses):
    said = refuses(main, "export", folder / "pan.h5", "--out", folder / "other.glb")
    assert "expected a Carillon design file" in said
