"""Meshes of scenes as solids: their modes beside theory, which way is up, what is refused."""

import numpy as np
import pytest
import trimesh

from carillon.errors import UserError
from carillon.fem.model import RIGID_MODES
from sound.scenes.bodies import bodies_of, with_modes
from tests.scenes import scene
from tests.theories import plate_frequencies, rod_frequencies

ALUMINIUM = {"material": "aluminium"}


def body(**given):
    """The one object of a scene."""
    (found,) = with_modes(bodies_of(scene({"name": "it", **given}).objects))
    return found


def written(surface, path):
    surface.export(path)
    return str(path)


def block(*sides):
    return trimesh.creation.box(extents=sides)


def test_a_thin_rod_sounds_as_beam_theory_says(tmp_path):
    rod = written(trimesh.creation.cylinder(0.01, 0.25, sections=32), tmp_path / "rod.obj")
    found = body(mesh=rod, **ALUMINIUM, count=3)
    material = found.entry.made_of
    # A prism of 32 sides is 0.3 % less stiff against bending for its mass than a round rod.
    wanted = rod_frequencies(0.25, 0.01, material.young, material.poisson, material.density)[0]
    assert found.solid.frequencies[:2] == pytest.approx(wanted, rel=0.01)
    assert found.accuracy["discretisation"] == "finite-cell"
    assert 0.0 < found.accuracy["solid_frequency_error_rms"] < 0.05


def test_a_sheet_thinner_than_a_spacing_sounds_as_a_thin_plate(tmp_path):
    sheet = written(block(0.2, 0.2, 0.0008), tmp_path / "sheet.obj")
    found = body(mesh=sheet, material="steel", count=3, resolution=20, collision="hull")
    material = found.entry.made_of
    wanted = plate_frequencies(0.2, 0.0008, material.young, material.density)[0]
    assert found.solid.frequencies[0] == pytest.approx(wanted, rel=0.02)
    assert found.mass == pytest.approx(material.density * 0.2**2 * 0.0008, rel=1e-6)


def test_size_modulus_and_density_are_those_of_a_solid_that_is_solved_so(tmp_path, monkeypatch):
    bar = written(block(0.3, 0.06, 0.04), tmp_path / "bar.obj")
    given = {"mesh": bar, "unit": 0.5, "resolution": 8, "count": 4, "density": 5000.0}
    shared = body(**given, **ALUMINIUM)
    small = written(block(0.15, 0.03, 0.02), tmp_path / "small.obj")
    own = body(**{**given, "mesh": small, "unit": 1.0}, **ALUMINIUM)
    assert shared.solid.frequencies == pytest.approx(own.solid.frequencies, rel=1e-6)
    assert shared.mass == pytest.approx(own.mass, rel=1e-9)
    corner = np.array([[0.07, 0.01, 0.005]])
    # Mode for mode, but for the sign that an eigensolver leaves open.
    moved = [np.abs(each.motion(corner)) for each in (shared, own)]
    assert moved[0] == pytest.approx(moved[1], rel=1e-3, abs=1e-3 * moved[1].max())


def test_modes_are_found_once_for_all_sizes_and_materials_of_one_ratio(monkeypatch):
    import sound.scenes.solved as solid

    solved = []
    solve = solid.solve_refined
    monkeypatch.setattr(solid, "solve_refined", lambda *a, **k: solved.append(1) or solve(*a, **k))
    given = {"mesh": "builtin:bar", "count": 2, "resolution": 9, "collision": "hull"}
    described = scene(
        *[
            {"name": f"{unit} {pitch}", "unit": unit, "pitch": pitch, **given, **ALUMINIUM}
            for unit, pitch in ((1.0, None), (2.0, None), (1.0, 700.0))
        ]
    )
    bodies = with_modes(bodies_of(described.objects))
    assert len(solved) == 1
    first, twice, pitched = (each.solid.frequencies[0] for each in bodies)
    assert twice == pytest.approx(first / 2.0) and pitched == pytest.approx(700.0, rel=1e-4)


def test_what_was_found_before_is_the_same_to_the_last_bit():
    given = {"mesh": "builtin:bar", "material": "wood", "count": 3, "resolution": 9}
    first, again = (body(**given, collision="hull") for _ in range(2))
    assert np.array_equal(first.solid.frequencies, again.solid.frequencies)
    assert np.array_equal(first.solid.modes, again.solid.modes)
    assert first.mass == again.mass and np.array_equal(first.inertia, again.inertia)
    assert first.accuracy == again.accuracy


@pytest.mark.parametrize("count", [0, 2])
def test_voxels_are_as_they_were_and_told_how_far_off_they_are(count):
    from carillon.fem.geometry import builtin_surface, hexmesh_from_voxels, voxelize

    mesh = hexmesh_from_voxels(voxelize(builtin_surface("bar"), 12))
    found = body(
        mesh="builtin:bar", **ALUMINIUM, resolution=12, count=count, discretisation="voxel"
    )
    volume = mesh.n_cells * mesh.edge**3
    assert found.mass == pytest.approx(volume * found.entry.made_of.density, rel=1e-9)
    if count:
        assert found.accuracy["discretisation"] == "voxel"
        # Voxels at this resolution make the bar thicker: the estimate says so.
        assert abs(found.accuracy["solid_frequency_error_rms"]) > 0.05
    else:
        assert found.accuracy is None and found.solid is None


def test_the_modes_are_found_where_the_distance_cannot_be_told(monkeypatch, capsys):
    import solver.accuracy.divide as divide

    def fails(*_):
        raise FloatingPointError("a fault")

    monkeypatch.setattr(divide, "estimate_cell_errors", fails)
    found = body(mesh="builtin:bar", material="glass", count=2, resolution=9, collision="hull")
    assert len(found.solid.frequencies) == 2
    assert found.accuracy == {"discretisation": "finite-cell", "resolution": 9}
    assert "cannot be told: FloatingPointError: a fault" in capsys.readouterr().err


def test_refusals_name_keys_of_a_scene_and_what_helps(tmp_path):
    sheet = written(block(0.2, 0.2, 0.0008), tmp_path / "sheet.obj")
    given = {"mesh": sheet, "material": "steel", "resolution": 40}
    with pytest.raises(UserError) as refused:
        body(**given, discretisation="voxel")
    assert "resolution" in str(refused.value) and "--" not in str(refused.value)
    assert "discretisation: auto" in str(refused.value)
    apart = trimesh.util.concatenate([block(1, 1, 1), block(1, 1, 1).apply_translation([3, 0, 0])])
    pieces = written(apart, tmp_path / "apart.obj")
    with pytest.raises(UserError, match="components: largest"):
        body(mesh=pieces, material="steel", count=0, resolution=12)
    one = body(mesh=pieces, material="steel", count=0, resolution=12, components="largest")
    assert one.mass == pytest.approx(one.entry.made_of.density, rel=1e-6)


def boards(overlap):
    """A closed box of six boards 10 mm thick, which abut, or overlap at the edges."""
    sides, t = np.array([0.4, 0.3, 0.25]), 0.01
    made = []
    for axis in range(3):
        low, high = np.zeros(3), sides.copy()
        if not overlap:
            low[axis + 1 :] += t
            high[axis + 1 :] -= t
        for end in (0.0, sides[axis] - t):
            low[axis], high[axis] = end, end + t
            made.append(block(*(high - low)).apply_translation((low + high) / 2.0))
    return trimesh.util.concatenate(made)


@pytest.mark.parametrize("overlap", [False, True])
def test_a_box_of_boards_is_a_solid_of_six_parts(tmp_path, overlap):
    path = written(boards(overlap), tmp_path / "boards.obj")
    found = body(mesh=path, material="wood", count=0, resolution=16)
    assert len(found.parts) == 6
    hollow = 0.4 * 0.3 * 0.25 - 0.38 * 0.28 * 0.23
    assert found.mass == pytest.approx(found.entry.made_of.density * hollow, rel=1e-6)


class TestUp:
    """glTF's y points up."""

    lying = (0.4, 0.02, 0.1)

    def given(self, tmp_path, ending):
        path = written(block(*self.lying), tmp_path / f"bar.{ending}")
        return {"mesh": path, "material": "steel", "resolution": 12}

    @pytest.mark.parametrize("ending", ["glb", "gltf"])
    def test_a_bar_lies_as_in_the_program_that_wrote_it(self, tmp_path, ending):
        found = body(**self.given(tmp_path, ending), count=4)
        assert np.ptp(found.shape.vertices, axis=0) == pytest.approx([0.4, 0.1, 0.02])
        assert np.ptp(np.concatenate(found.parts), axis=0) == pytest.approx([0.4, 0.1, 0.02])
        squares = np.array([0.4, 0.1, 0.02]) ** 2
        wanted = found.mass / 12.0 * (squares.sum() - squares)
        assert np.diag(found.inertia) == pytest.approx(wanted, rel=1e-3)

    def test_other_files_stay_as_they_are(self, tmp_path):
        found = body(**self.given(tmp_path, "obj"), count=0)
        assert np.ptp(found.shape.vertices, axis=0) == pytest.approx(self.lying)

    def test_its_modes_turn_with_it(self, tmp_path):
        turned = body(**self.given(tmp_path, "glb"), count=4)
        plain = body(**self.given(tmp_path, "obj"), count=4)
        assert turned.solid.frequencies == pytest.approx(plain.solid.frequencies, rel=1e-6)
        # The first bends the bar across its thickness, which is z now.
        moved = turned.motion(np.array([[0.2, 0.05, 0.01]]))[0, :, 0]
        assert np.abs(moved).argmax() == 2
        own = plain.motion(np.array([[0.2, 0.01, -0.05]]))[0, :, 0]
        assert abs(moved[2]) == pytest.approx(abs(own[1]), rel=1e-3)

    def test_modes_of_a_file_stand_as_its_mesh_does(self, tmp_path):
        from solver.__main__ import main

        path, modes = self.given(tmp_path, "glb")["mesh"], str(tmp_path / "bar.h5")
        how = ["--resolution", "12", "--modes", str(RIGID_MODES + 3), "--method", "hcms"]
        assert main(["modes", path, *how, "--discretisation", "finite-cell", "--out", modes]) == 0
        found = body(modes=modes)
        # Its surface is that of the voxels, which are as thick as a spacing or two.
        long, wide, thick = np.ptp(found.shape.vertices, axis=0)
        assert long > 0.39 and 0.09 < wide < 0.15 and thick < 0.07
        assert found.accuracy["solid_frequency_error_rms"] > 0.0


def test_one_motion_is_heard_by_the_modes_of_either_file(tmp_path):
    from solver.__main__ import main
    from sound.scenes.playing.play import perform
    from tests.scenes import require_engine

    require_engine()
    how = ["builtin:bar", "--resolution", "12", "--modes", "10", "--no-estimate", "--out"]
    files = [str(tmp_path / f"{name}.h5") for name in ("fine", "coarse", "other")]
    for file, more in zip(files, ([], ["--coarsen", "average"], ["--unit", "2"])):
        assert main(["modes", *how, file, *more]) == 0
    given = {"name": "bar", "modes": files[0], "material": "steel", "position": [0, 0, 0.1]}
    given["rotation"] = [0, 20, 0]
    sound = {"full_scale": 1e3, "rate": 8000}
    fine, coarse, same = (
        perform(scene({**given, **heard}, seconds=0.3, sound=sound), 1, visible=False)
        for heard in ({}, {"heard_modes": files[1]}, {"heard_modes": files[0]})
    )
    assert np.array_equal(fine.picture.motion.positions, coarse.picture.motion.positions)
    assert np.array_equal(fine.sound, same.sound)
    assert fine.voices[0].frequencies[0] != coarse.voices[0].frequencies[0]
    assert np.abs(fine.sound - coarse.sound).max() > 0.01 * np.abs(fine.sound).max()
    with pytest.raises(UserError, match="is of another solid"):
        body(**{**given, "name": "it", "heard_modes": files[2]})


def test_a_rod_is_as_near_as_modes_of_an_accuracy_and_told_in_cents(tmp_path):
    from sound.scenes.expected_cents import in_cents

    rod = written(trimesh.creation.cylinder(0.01, 0.25, sections=32), tmp_path / "rod.obj")
    rough = body(mesh=rod, **ALUMINIUM, count=40, accuracy=None)
    found = body(mesh=rod, **ALUMINIUM, count=40)
    assert rough.accuracy["divided_cells"] == 0 < found.accuracy["divided_cells"]
    assert found.accuracy["solid_frequency_error_rms"] < 0.01
    assert "missed_accuracy" not in found.accuracy
    material = found.entry.made_of
    bending = rod_frequencies(0.25, 0.01, material.young, material.poisson, material.density)
    bent = found.solid.frequencies[[0, 2, 5]]  # the fifth twists
    cents = 1200.0 * np.log2(bent / np.asarray(bending)[:3])
    assert np.abs(cents).max() < 10.0
    told = in_cents(found.accuracy)
    assert 0.0 < told["expected_cents_rms"] < 17.3 < 52.0
    assert in_cents(None) == {}
    # As a rigid body it is the same however its cells are divided.
    assert (found.mass, found.inertia.tolist()) == (rough.mass, rough.inertia.tolist())


def test_a_mesh_has_the_size_and_the_axis_up_that_it_is_given(tmp_path):
    bar = written(block(40.0, 2.0, 10.0), tmp_path / "bar.obj")
    found = body(mesh=bar, material="steel", count=0, size=0.2, up="y", resolution=12)
    assert np.ptp(found.shape.vertices, axis=0) == pytest.approx([0.2, 0.05, 0.01])
    assert found.mass == pytest.approx(7850.0 * 0.2 * 0.05 * 0.01, rel=0.02)
    with pytest.raises(UserError, match="leave out the unit"):
        body(mesh=bar, material="steel", size=0.2, unit=0.1)
    with pytest.raises(UserError, match="leave out the size"):
        body(mesh=bar, material="steel", size=0.2, pitch=440.0)
    with pytest.raises(UserError, match="size goes with mesh, found a radius"):
        body(radius=0.1, material="steel", size=0.2)
    along = body(mesh=bar, material="steel", count=0, size=0.2, up="x", resolution=12)
    assert np.ptp(along.shape.vertices, axis=0) == pytest.approx([0.05, 0.01, 0.2])
    hung = {up: body(mesh=bar, material="steel", count=0, size=0.2, up=up) for up in ("-y", "y")}
    bars = [each.shape.vertices * (1.0, -1.0, -1.0) for each in hung.values()]
    assert bars[0] == pytest.approx(hung["y"].shape.vertices, abs=1e-12)
    with pytest.raises(
        UserError, match=r"up \(it\): found 'north', expected one of x, y, z, -x, -y, -z"
    ):
        body(mesh=bar, material="steel", up="north")
    plain = body(mesh=bar, material="steel", count=0, size=0.2, resolution=12)
    assert np.ptp(plain.shape.vertices, axis=0) == pytest.approx([0.2, 0.01, 0.05])
