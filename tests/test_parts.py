"""Named parts of scenes are the surfaces that they are in the file, in their places."""

import zipfile

import numpy as np
import pytest
import trimesh

from carillon.errors import UserError
from carillon.fem.geometry import load_surface
from carillon.fem.geometry.parts import named_surfaces
from tests.mesh_files import Gltf, block, gltf, inside_out

SHAFT, HEAD = block((0, 0, 0), (0.1, 0.1, 0.3)), block((-0.1, -0.1, 0.3), (0.2, 0.2, 0.4))
SPACE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"


def volumes(parts):
    return {name: round(surface.volume, 9) for name, surface in parts}


def scene(*parts: tuple[str, trimesh.Trimesh], materials=()) -> Gltf:
    """Parts as nodes of glTF; with `materials` as primitives of one mesh."""
    file = gltf(parts[0][1])
    primitives = []
    for _, surface in parts:
        positions = file.accessor(np.asarray(surface.vertices), 5126)
        corners = file.accessor(np.asarray(surface.faces).ravel(), 5125)
        primitives.append({"attributes": {"POSITION": positions}, "indices": corners})
    if materials:
        for number, primitive in enumerate(primitives):
            primitive["material"] = number
        file.header["materials"] = [{"name": name} for name in materials]
        file.header["meshes"] = [{"name": "hammer", "primitives": primitives}]
        return file
    file.header["meshes"] = [{"primitives": [each]} for each in primitives]
    file.header["nodes"] = [{"mesh": k, "name": name} for k, (name, _) in enumerate(parts)]
    file.header["scenes"] = [{"nodes": list(range(len(parts)))}]
    return file


def test_nodes_of_gltf_are_parts_in_their_places(tmp_path):
    file = scene(("shaft", SHAFT), ("head", HEAD))
    file.header["nodes"][1] |= {"translation": [0.0, 0.0, 1.0], "scale": [2.0, 1.0, 1.0]}
    file.header["nodes"][0]["rotation"] = [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]
    file.header["nodes"].append({"children": [0, 1], "matrix": np.diag([3.0, 3, 3, 1]).ravel()})
    file.header["nodes"][-1]["matrix"] = file.header["nodes"][-1]["matrix"].tolist()
    file.header["scenes"] = [{"nodes": [2]}]
    path = file.written(tmp_path / "hammer.glb")
    parts = named_surfaces(path, unit=0.5)
    expected = {"shaft": 0.003 * 1.5**3, "head": 2 * 0.009 * 1.5**3}
    assert volumes(parts) == pytest.approx(expected, rel=1e-6)  # single precision
    whole = load_surface(path, unit=0.5)
    corners = np.concatenate([surface.triangles for _, surface in parts]).reshape(-1, 9)
    expected = np.asarray(whole.triangles).reshape(-1, 9)
    np.testing.assert_allclose(np.sort(corners, axis=0), np.sort(expected, axis=0), atol=1e-6)


def test_closed_materials_of_a_node_are_parts_and_open_ones_are_not(tmp_path):
    file = scene(("", SHAFT), ("", HEAD), materials=("wood", "steel"))
    parts = named_surfaces(file.written(tmp_path / "hammer.glb"))
    assert volumes(parts) == {"hammer/wood": 0.003, "hammer/steel": 0.009}
    halves = [trimesh.Trimesh(HEAD.vertices, HEAD.faces[k::2], process=False) for k in (0, 1)]
    file = scene(*(("", half) for half in halves), materials=("wood", "steel"))
    assert volumes(named_surfaces(file.written(tmp_path / "head.gltf"))) == {"hammer": 0.009}


OBJ = {
    "objects": ["o shaft", "o head"],
    "groups": ["g shaft", "g head"],
    "materials": ["usemtl shaft", "usemtl head"],
    "nothing": ["", ""],
}


@pytest.mark.parametrize("form", OBJ)
def test_objects_groups_and_materials_of_obj_are_parts(tmp_path, form):
    lines, count = [], 0
    for surface, line in zip((SHAFT, HEAD), OBJ[form], strict=True):
        lines += [f"v {x} {y} {z}" for x, y, z in surface.vertices.tolist()]
        # Groups of both kinds, in the middle of a body that they do not part.
        lines += [line, *(f"f {a} {b} {c}" for a, b, c in (surface.faces[:5] + count + 1).tolist())]
        lines += [
            "s 1",
            *(f"f {a} {b} {c}" for a, b, c in (surface.faces[5:] + count + 1).tolist()),
        ]
        count += len(surface.vertices)
    path = tmp_path / "hammer.obj"
    path.write_text("\n".join(lines))
    expected = {"hammer": 0.012} if form == "nothing" else {"shaft": 0.003, "head": 0.009}
    assert volumes(named_surfaces(path)) == expected


def test_an_object_whose_groups_are_open_stays_whole(tmp_path):
    lines = ["o box", *(f"v {x} {y} {z}" for x, y, z in HEAD.vertices.tolist())]
    for number, face in enumerate((HEAD.faces + 1).tolist()):
        lines += [f"g side{number // 4}", "f {} {} {}".format(*face)]
    (tmp_path / "b.obj").write_text("\n".join(lines))
    assert volumes(named_surfaces(tmp_path / "b.obj")) == {"box": 0.009}


def three_mf(path, objects, build, more=()):
    """A 3MF file of objects (number, name, surface or components)."""
    text = []
    for number, name, content in objects:
        if isinstance(content, str):
            inner = f"<components>{content}</components>"
        else:
            points = "".join('<vertex x="{}" y="{}" z="{}"/>'.format(*p) for p in content.vertices)
            faces = "".join('<triangle v1="{}" v2="{}" v3="{}"/>'.format(*f) for f in content.faces)
            inner = f"<mesh><vertices>{points}</vertices><triangles>{faces}</triangles></mesh>"
        text.append(f'<object id="{number}" name="{name}" type="model">{inner}</object>')
    model = f'<model xmlns="{SPACE}" unit="meter"><resources>{"".join(text)}</resources>'
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("3D/3dmodel.model", f"{model}<build>{build}</build></model>")
        for name, content in more:
            archive.writestr(name, content)
    return path


def test_objects_of_3mf_are_parts_in_their_places(tmp_path):
    moved = '<component objectid="2" transform="0 1 0 -1 0 0 0 0 1 5 0 0"/>'
    path = three_mf(
        tmp_path / "hammer.3mf",
        [
            (1, "shaft", SHAFT),
            (2, "head", HEAD),
            (3, "all", f'<component objectid="1"/>{moved}'),
            (4, "unused", HEAD),
        ],
        '<item objectid="3" transform="2 0 0 0 2 0 0 0 2 0 0 7"/>',
    )
    parts = named_surfaces(path)
    assert volumes(parts) == {"shaft": 0.024, "head": 0.072}
    # A quarter turn, along x by five, then twice as large and up by seven.
    expected = 2.0 * (HEAD.vertices @ [[0, 1, 0], [-1, 0, 0], [0, 0, 1]] + [5, 0, 0]) + [0, 0, 7]
    np.testing.assert_allclose(np.sort(parts[1][1].vertices, 0), np.sort(expected, 0))
    assert load_surface(str(path)).volume == pytest.approx(0.096)


def test_several_files_are_parts_by_their_names_and_each_is_turned_outwards(tmp_path):
    inside_out(SHAFT).export(tmp_path / "shaft.stl")
    HEAD.export(tmp_path / "head.ply")
    parts = named_surfaces([tmp_path / "shaft.stl", tmp_path / "head.ply", "builtin:box"])
    assert [name for name, _ in parts] == ["shaft", "head", "box"]
    assert volumes(parts)["shaft"] == 0.003 and volumes(parts)["head"] == 0.009


def test_flat_parts_are_left_out_and_a_bad_part_is_named(tmp_path):
    sheet = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], process=False)
    file = scene(("head", HEAD), ("label", sheet))
    assert volumes(named_surfaces(file.written(tmp_path / "a.glb"))) == {"head": 0.009}
    with pytest.raises(UserError, match="no part that encloses anything"):
        named_surfaces(scene(("label", sheet)).written(tmp_path / "b.glb"))
    far = block((1e10, 0, 0), (1e10 + 1.0, 1.0, 1.0))
    lines = [f"v {x} {y} {z}" for part in (HEAD, far) for x, y, z in part.vertices.tolist()]
    lines += ["o head", *("f {} {} {}".format(*face) for face in (HEAD.faces + 1).tolist())]
    lines += ["o far", *("f {} {} {}".format(*face) for face in (far.faces + 9).tolist())]
    (tmp_path / "c.obj").write_text("\n".join(lines))
    with pytest.raises(UserError, match="c.obj, part 'far'.* from the origin"):
        named_surfaces(tmp_path / "c.obj")


def test_many_objects_take_no_time_of_their_square(tmp_path):
    lines, names = [], 1000
    for number in range(names):
        moved = block((number, 0, 0), (number + 0.5, 0.5, 0.5))
        lines += [f"v {x} {y} {z}" for x, y, z in moved.vertices.tolist()]
        faces = (moved.faces + 8 * number + 1).tolist()
        lines += [f"o {number}", *("f {} {} {}".format(*face) for face in faces)]
    (tmp_path / "many.obj").write_text("\n".join(lines))
    assert len(named_surfaces(tmp_path / "many.obj")) == names


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"", "could not be read as a mesh"),
        (b"PK\3\4", "could not be read as a mesh"),
        (None, "could not be read as a mesh"),
    ],
)
def test_a_bad_3mf_file_is_refused_in_one_sentence(tmp_path, content, sentence):
    path = tmp_path / "a.3mf"
    if content is None:
        three_mf(path, [(1, "a", '<component objectid="1"/>')], '<item objectid="1"/>')
    else:
        path.write_bytes(content)
    for read in (named_surfaces, lambda name: load_surface(str(name))):
        with pytest.raises(UserError, match=sentence):
            read(path)
