"""Parts of designs that were built: closed surfaces, files that other programs read, and tables."""

import csv
import json
import zipfile
from dataclasses import replace
from importlib.util import find_spec
from xml.etree import ElementTree

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from carillon.errors import UserError
from carillon.fem.geometry.parts import named_surfaces
from solver.__main__ import main as solver_main
from solver.files.modes_file import read_modes
from sound.__main__ import main
from sound.building.restriction import built
from sound.export import parts as parts_module
from sound.export.formats import export_design, format_of
from sound.export.parts import MILLIMETRES, built_parts
from sound.export.parts_folder import write_parts
from sound.export.threemf import MODEL, NAMESPACE
from sound.export.voxel_surface import GAP, voxel_surface
from sound.project.design_file import write_design
from tests.small_design import small_design
from tests.test_sound_build import TWO, designed


@st.composite
def voxels(draw):
    shape = draw(st.tuples(*[st.integers(1, 4)] * 3))
    bits = draw(st.lists(st.booleans(), min_size=int(np.prod(shape)), max_size=int(np.prod(shape))))
    return np.array(bits).reshape(shape)


@given(voxels())
def test_surfaces_of_voxels_are_closed_manifolds(filled):
    """However they meet: each edge is of two triangles, the triangles at a vertex are one fan."""
    vertices, faces = voxel_surface(filled)
    if not filled.any():
        assert not len(faces)
        return
    surface = trimesh.Trimesh(vertices, faces, process=False)
    ends, counts = np.unique(np.sort(surface.edges, axis=1), axis=0, return_counts=True)
    assert (counts == 2).all()
    assert surface.is_winding_consistent
    assert len(np.unique(vertices.round(9), axis=0)) == len(vertices)
    for vertex in range(len(vertices)):
        around = np.flatnonzero((faces == vertex).any(axis=1))
        pairs = surface.face_adjacency
        shared = (surface.face_adjacency_edges == vertex).any(axis=1)
        fans = trimesh.graph.connected_components(pairs[shared], nodes=around)
        assert len(fans) == 1
    # Gaps where voxels touch take a little of each.
    assert filled.sum() * (1.0 - 2.0 * GAP) ** 3 - 1e-9 <= surface.volume <= filled.sum() + 1e-9


def test_surfaces_of_voxels_that_share_faces_lie_on_those():
    vertices, faces = voxel_surface(np.ones((3, 2, 1), dtype=bool))
    assert np.array_equal(vertices, vertices.round())
    assert trimesh.Trimesh(vertices, faces, process=False).volume == pytest.approx(6.0)


@pytest.fixture(scope="module")
def design(tmp_path_factory):
    problem, field = designed(tmp_path_factory.mktemp("parts"), TWO)
    return built(problem, field)


@pytest.fixture
def voxel_faced(monkeypatch):
    monkeypatch.setattr(parts_module, "find_spec", lambda name: None)


def test_parts_fill_the_solid(design, voxel_faced):
    made = built_parts(design)
    assert not made.is_clipped
    assert sum(part.volume * part.density for part in made.parts) == pytest.approx(
        design.model.mass, rel=6.0 * GAP
    )


@pytest.mark.skipif(find_spec("manifold3d") is None, reason="manifold3d (requirements-parts.txt)")
def test_clipped_parts_fill_the_surface(design):
    made = built_parts(design)
    whole = trimesh.Trimesh(design.surface_vertices, design.surface_faces)
    assert made.is_clipped
    # Gaps where parts touch themselves.
    assert sum(part.volume for part in made.parts) == pytest.approx(whole.volume, rel=6.0 * GAP)


def test_files_of_parts_hold_the_same(design, tmp_path, voxel_faced):
    written = write_parts(tmp_path / "made", design)
    folder = tmp_path / "made"
    assert sorted(path.name for path in folder.iterdir()) == sorted(written.files)
    table = json.loads((folder / "parts.json").read_text())
    assert table["unit"] == "mm" and table["parts"] == written.rows
    with open(folder / "parts.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    surfaces = dict(named_surfaces(str(folder / "parts.3mf"), 1e-3))
    for row, listed in zip(written.rows, rows, strict=True):
        stl = trimesh.load(folder / row["file"])
        assert stl.is_watertight and stl.is_winding_consistent
        assert stl.volume == pytest.approx(row["volume_mm3"], rel=1e-5)
        assert stl.extents == pytest.approx(row["extents_mm"], rel=1e-5)
        assert float(listed["mass_g"]) == pytest.approx(row["mass_g"])
        assert row["mass_g"] == pytest.approx(row["volume_mm3"] * row["density_kg_per_m3"] * 1e-6)
        inside = surfaces[row["material"]]
        assert inside.is_watertight
        assert inside.volume == pytest.approx(row["volume_mm3"] / MILLIMETRES**3, rel=1e-5)
    with zipfile.ZipFile(folder / "parts.3mf") as archive:
        model = ElementTree.fromstring(archive.read(MODEL))
    assert model.get("unit") == "millimeter"
    bases = model.findall(f".//{{{NAMESPACE}}}base")
    assert [each.get("name") for each in bases] == [row["material"] for row in written.rows]
    assert len({each.get("displaycolor") for each in bases}) == len(bases)


def test_modes_of_the_parts_are_those_of_the_design(design, tmp_path, voxel_faced):
    write_parts(tmp_path, design)
    side = np.ptp(design.model.mesh.nodes, axis=0).max() / design.fine_edge
    arguments = ["modes", f"{tmp_path}/solid.stl", "--unit", "mm", "--regions"]
    arguments += [f"{tmp_path}/regions.yaml", "--resolution", str(round(side)), "--modes"]
    arguments += [str(len(design.eigenvalues)), "--out", f"{tmp_path}/modes.h5"]
    assert solver_main(arguments) == 0
    # STL holds single precision.
    found = read_modes(tmp_path / "modes.h5").frequencies
    assert found[6:] == pytest.approx(design.frequencies, rel=1e-4)


def of_materials(design, *names):
    """The design with other names of its materials."""
    build = design.evidence["build"]
    told = [{**each, "name": name} for each, name in zip(build["materials"], names, strict=True)]
    return replace(design, evidence={**design.evidence, "build": {**build, "materials": told}})


def names_in(folder):
    return sorted(path.name for path in folder.iterdir())


def test_parts_of_a_former_export_make_room_and_others_stay(design, tmp_path, voxel_faced):
    path = tmp_path / "made"
    former = write_parts(path, of_materials(design, "Own metal", "steel"))
    assert {"own_metal.stl", "steel.stl"} <= set(former.files) and not former.removed
    for name in ("mine.stl", "notes.txt"):
        (path / name).write_text("of others")
    written = write_parts(path, of_materials(design, "aluminium", "steel"))
    assert written.removed == ["own_metal.stl"]
    assert names_in(path) == sorted(["mine.stl", "notes.txt", *written.files])
    assert json.loads((path / "parts.json").read_text())["files"] == written.files


def test_files_that_no_export_of_parts_writes_are_not_removed(design, tmp_path, voxel_faced):
    path = tmp_path / "made"
    path.mkdir()
    kept = [path / "notes.txt", tmp_path / "outside.stl"]
    for file in kept:
        file.write_text("of others")
    listed = ["notes.txt", "../outside.stl", str(tmp_path / "outside.stl"), 7]
    table = {"format": "carillon parts 1", "files": listed}
    (path / "parts.json").write_text(json.dumps(table))
    assert not write_parts(path, design).removed
    assert all(file.read_text() == "of others" for file in kept)


def test_an_export_of_parts_that_fails_leaves_the_former_one(
    design, tmp_path, voxel_faced, monkeypatch
):
    def full(*_):
        raise OSError(28, "No space left on device")

    path = tmp_path / "made"
    write_parts(path, design)
    before = {name: (path / name).read_bytes() for name in names_in(path)}
    monkeypatch.setattr("sound.export.parts_folder.regions_text", full)
    with pytest.raises(UserError, match="No space left on device"):
        write_parts(path, of_materials(design, "one", "another"))
    assert {name: (path / name).read_bytes() for name in names_in(path)} == before
    with pytest.raises(UserError, match="No space left on device"):
        write_parts(tmp_path / "new", design)
    assert not (tmp_path / "new").exists()


def test_a_material_called_solid_has_a_file_of_its_own(design, tmp_path, voxel_faced):
    written = write_parts(tmp_path / "made", of_materials(design, "Solid", "steel"))
    assert {"solid.stl", "solid_2.stl"} <= set(written.files)
    assert len(set(written.files)) == len(written.files)


def test_the_command_writes_a_folder(design, tmp_path, capsys):
    write_design(tmp_path / "bar.h5", design)
    out = f"{tmp_path}/made/"
    arguments = ["export", str(tmp_path / "bar.h5"), "--format", "parts", "--out", out]
    assert main([*arguments, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert {"aluminium", "steel"} >= {row["material"] for row in told["parts"]}
    assert "in millimetres" in told["sentence"]
    assert format_of(out, "parts") == "parts"


def test_moduli_alone_do_not_tell_what_is_built(design, tmp_path):
    with pytest.raises(UserError, match="several densities"):
        export_design(tmp_path / "young.npy", design, "npy")


def test_a_field_has_no_parts(tmp_path):
    with pytest.raises(UserError, match="continuous field, which has no parts"):
        write_parts(tmp_path, small_design())


def test_parts_that_cannot_be_printed_are_refused(design, tmp_path):
    told = {**design.evidence["build"], "at_least_m": 1e-4}
    thin = replace(design, evidence={**design.evidence, "build": told})
    with pytest.raises(UserError, match="as thin as 0.1 mm, expected 0.4 mm"):
        write_parts(tmp_path, thin)
