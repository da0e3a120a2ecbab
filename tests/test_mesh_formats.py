"""A mesh is the same solid, whichever of the ways that its format allows it is written in."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from carillon.errors import UserError
from carillon.fem.geometry import load_surface, voxelize
from carillon.fem.geometry.orientation import turned_alike
from carillon.fem.geometry.plain_files import plain_obj
from solver.analysis.problem import ProblemOptions, build_problem
from tests.mesh_files import DTYPES, Gltf, block, concatenated, gltf

SIDES = np.array([0.4, 0.1, 0.1])
BOX = block(tuple(-SIDES / 2), tuple(SIDES / 2))
HALVES = (
    block((-0.2, -0.05, -0.05), (0.05, 0.05, 0.05)),
    block((-0.05, -0.05, -0.05), (0.2, 0.05, 0.05)),
)


def same_triangles(surface: trimesh.Trimesh, expected: trimesh.Trimesh, tolerance: float) -> bool:
    """Whether two surfaces have the same triangles, in order."""
    one, other = np.asarray(surface.triangles), np.asarray(expected.triangles)
    return one.shape == other.shape and bool(np.abs(one - other).max() <= tolerance)


# OBJ ----------------------------------------------------------------------------------------------


def obj(parts, face=lambda corner, count: str(corner + 1), head="v", tail="f", end="\n"):
    """Parts in turn, vertices before faces; `face` writes a corner after so many vertices."""
    text, count = [], 0
    for part in parts:
        text += [f"{head} {' '.join(map(repr, row))}" for row in part.vertices.tolist()]
        count += len(part.vertices)
        before = count - len(part.vertices)
        for corners in part.faces.tolist():
            text.append(f"{tail} {' '.join(face(before + each, count) for each in corners)}")
    return end.join([*text, ""])


def back(corner: int, count: int) -> str:
    return str(corner - count)


MORE = "vt 0 0\nvt 1 0\nvn 0 0 1\n"
FORMS = {
    "absolute": obj(HALVES),
    "counting back": obj(HALVES, back),
    "with texture": MORE + obj(HALVES, lambda *each: f"{back(*each)}/-1"),
    "with normal": MORE + obj(HALVES, lambda *each: f"{back(*each)}//-1"),
    "with both": MORE + obj(HALVES, lambda *each: f"{back(*each)}/-2/-1"),
    "texture back alone": MORE + obj(HALVES, lambda corner, _: f"{corner + 1}/-2/1"),
    "groups and lines": "o one\ng a b\ns 1\n" + obj(HALVES, back).replace("f ", "l -1 -2\nf ", 1),
    "going on": obj(HALVES, back).replace(" -", " \\\n-"),
    "going on, tight": obj(HALVES).replace("f 1 2", "f 1\\\n2").replace("f 5 ", "f 5\\\n"),
    "indented, tabs": obj(HALVES, back, head="  v\t", tail="\tf\t"),
    "comments": obj(HALVES, back, end=" # here: f 1 2 3\n"),
    "carriage returns": obj(HALVES, back, end="\r\n"),
    "old carriage returns": obj(HALVES, end="\r"),
    "byte-order mark": "\ufeff" + obj(HALVES),
}


@pytest.mark.parametrize("form", FORMS)
def test_an_obj_file_is_one_solid_in_all_forms(tmp_path, form):
    path = tmp_path / "halves.obj"
    path.write_bytes(FORMS[form].encode())
    found = load_surface(str(path))
    expected = np.sort(np.asarray(concatenated(*HALVES).triangles).reshape(-1, 9), axis=0)
    assert np.array_equal(np.sort(np.asarray(found.triangles).reshape(-1, 9), axis=0), expected)
    assert found.volume == pytest.approx(0.005)


@pytest.mark.parametrize("head", ["OFF\n8 7 0\n", "OFF 8 7 0 # a box\n"])
def test_an_off_file_may_have_faces_of_any_number_of_corners(tmp_path, head):
    """Five sides of four corners, and one of two triangles."""
    corners = [[x, y, z] for x in (0, 4) for y in (0, 1) for z in (0, 1)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4)]
    faces += [(1, 5, 7), (1, 7, 3)]
    lines = [" ".join(map(str, corner)) for corner in corners]
    lines += [" ".join(map(str, (len(face), *face))) for face in faces]
    path = tmp_path / "box.off"
    path.write_text(head + "\n".join(lines) + "\n")
    found = load_surface(str(path))
    assert len(found.faces) == 12 and found.volume == pytest.approx(4.0)


@pytest.mark.parametrize(
    ("face", "sentence"),
    [("3 0 1 -2", "names vertex -2"), ("4 0 1 2", "a face of 4 corners has 3")],
)
def test_an_off_file_with_a_strange_face_is_refused(tmp_path, face, sentence):
    path = tmp_path / "strange.off"
    path.write_text(f"OFF\n4 3 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 1 2\n4 0 1 2 3\n{face}\n")
    with pytest.raises(UserError, match=sentence):
        load_surface(str(path))


def test_an_ordinary_obj_file_is_read_as_it_is():
    """Not a byte of it changes, so that its solid keeps its bits."""
    content = (MORE + FORMS["absolute"]).encode()
    assert plain_obj(content) is content


def test_polygons_that_count_back_become_triangles(tmp_path):
    path = tmp_path / "quads.obj"
    quads = np.array(
        [[1, 2, 4, 3], [5, 7, 8, 6], [1, 5, 6, 2], [3, 4, 8, 7], [1, 3, 7, 5], [2, 6, 8, 4]]
    )
    corners = [f"v {x} {y} {z}" for x in (0, 0.4) for y in (0, 0.1) for z in (0, 0.1)]
    lines = [f"f {' '.join(str(each - 9) for each in quad)}" for quad in quads]
    path.write_text("\n".join([*corners, *lines]))
    found = load_surface(str(path))
    assert len(found.faces) == 12 and abs(found.volume) == pytest.approx(0.004)


@pytest.mark.parametrize("head", ["v 0.2", "v 0.2\r0.05 0.05", "# all\nv -0.05 0.05"])
def test_a_vertex_without_three_coordinates_is_refused(tmp_path, head):
    path = tmp_path / "cut.obj"
    path.write_bytes(FORMS["absolute"].replace("v 0.2 0.05 0.05", head, 1).encode())
    with pytest.raises(UserError, match="a vertex does not have three coordinates"):
        load_surface(str(path))


def test_faces_without_an_area_turn_no_others():
    corners = np.vstack([np.zeros(3), np.eye(3)])
    assert turned_alike(corners, np.array([[1, 1, 2], [2, 2, 3], [0, 3, 3]]), "lines") is None


@pytest.mark.parametrize("corner", ["0", "-4", "9"])
def test_a_face_of_a_vertex_that_is_not_there_is_refused(tmp_path, corner):
    path = tmp_path / "bad.obj"
    path.write_text(f"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 {corner}\nv 0 0 1\n")
    with pytest.raises(UserError, match="could not be read as a mesh"):
        load_surface(str(path))


# glTF ---------------------------------------------------------------------------------------------


def quantised(component: int, normalised: bool, stride: int | None = None) -> tuple[Gltf, float]:
    """The box in integers, scaled by its node; and half a step of them [m]."""
    info = np.iinfo(DTYPES[component])
    largest, signed = info.max, info.min < 0
    units = np.asarray(BOX.vertices) / SIDES.max()  # from -1/2 to 1/2
    steps = np.rint(units * 2 * largest) if signed else np.rint((units + 0.5) * largest)
    file = Gltf()
    positions = file.accessor(steps, component, stride, normalized=normalised)
    file.primitive["attributes"]["POSITION"] = positions
    file.primitive["indices"] = file.accessor(np.asarray(BOX.faces).ravel(), 5123)
    width = 1.0 if normalised else float(largest)
    scale = SIDES.max() / (2 * width if signed else width)
    file.header["nodes"][0]["scale"] = [scale] * 3
    if not signed:
        file.header["nodes"][0]["translation"] = [-SIDES.max() / 2] * 3
    file.header["extensionsUsed"] = file.header["extensionsRequired"] = ["KHR_mesh_quantization"]
    return file, SIDES.max() / largest


@pytest.mark.parametrize("ending", ["glb", "gltf"])
@pytest.mark.parametrize("normalised", [True, False], ids=["normalised", "plain"])
@pytest.mark.parametrize("component", [5120, 5121, 5122, 5123])
def test_quantised_positions_are_those_of_the_solid(tmp_path, component, normalised, ending):
    file, step = quantised(component, normalised, 4 if component in (5120, 5121) else 8)
    assert same_triangles(load_surface(file.written(tmp_path / f"box.{ending}")), BOX, step)


def test_rounding_of_positions_adds_no_layer_of_voxels(tmp_path):
    """A side of 0.10000305 instead of 0.1 m would be five voxels instead of four."""
    file, _ = quantised(5122, True, 8)
    voxels = voxelize(load_surface(file.written(tmp_path / "box.glb")), 16)
    assert voxels.shape == (16, 4, 4) and voxels.filled.all()
    assert voxels.edge == pytest.approx(0.025, rel=1e-4)


@pytest.mark.parametrize("base", [True, False], ids=["changed", "all"])
def test_sparse_positions_are_put_in_their_places(tmp_path, base):
    """Over values that are there, or over zeros."""
    file = gltf(BOX)
    rows = np.arange(3, 8) if base else np.arange(8)
    entry = file.header["accessors"][0]
    if base:
        wrong = np.array(BOX.vertices)
        wrong[rows] += 1.0
        entry["bufferView"] = file.view(wrong.astype("<f4"))
    else:
        del entry["bufferView"]
    entry["sparse"] = {
        "count": len(rows),
        "indices": {"bufferView": file.view(rows.astype("<u1")), "componentType": 5121},
        "values": {"bufferView": file.view(np.asarray(BOX.vertices)[rows].astype("<f4"))},
    }
    assert same_triangles(load_surface(file.written(tmp_path / "box.glb")), BOX, 1e-7)


def test_fans_of_triangles_count_and_lines_do_not(tmp_path):
    file = gltf(BOX)
    faces = np.asarray(BOX.faces)
    position = file.primitive["attributes"]["POSITION"]
    fans = [
        {"attributes": {"POSITION": position}, "mode": 6, "indices": file.accessor(face, 5123)}
        for face in faces[10:]
    ]
    file.primitive["indices"] = file.accessor(faces[:10].ravel(), 5123)
    edge = file.accessor(faces[0][:2], 5123)
    edges = {"attributes": {"POSITION": position}, "mode": 1, "indices": edge}
    file.header["meshes"][0]["primitives"] += [*fans, edges]
    assert same_triangles(load_surface(file.written(tmp_path / "box.gltf")), BOX, 1e-7)


def test_a_file_beside_it_may_have_a_name_with_spaces(tmp_path):
    file = gltf(BOX)
    path = Path(file.written(tmp_path / "box.gltf"))
    (tmp_path / "my data.bin").write_bytes(bytes(file.data))
    text = path.read_text()
    start = text.index("data:")
    path.write_text(text[:start] + "my%20data.bin" + text[text.index('"', start) :])
    assert same_triangles(load_surface(str(path)), BOX, 1e-7)


@pytest.mark.parametrize("ending", ["glb", "gltf"])
@pytest.mark.parametrize(
    "extension",
    ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression", "X_any"],
)
def test_a_file_that_needs_what_is_not_read_is_refused(tmp_path, extension, ending):
    file = gltf(BOX)
    file.header["extensionsRequired"] = ["KHR_materials_unlit", extension]
    with pytest.raises(UserError, match=f"needs {extension}, which is not read; export it without"):
        load_surface(file.written(tmp_path / f"box.{ending}"))


def test_extensions_of_colours_are_no_hindrance(tmp_path):
    file = gltf(BOX)
    names = ["KHR_materials_unlit", "KHR_texture_transform", "EXT_texture_webp"]
    names.append("KHR_mesh_quantization")
    file.header["extensionsRequired"] = names
    assert same_triangles(load_surface(file.written(tmp_path / "box.glb")), BOX, 1e-7)


def test_positions_that_are_in_an_extension_alone_are_refused(tmp_path):
    """Though the file does not say that it needs it."""
    file = gltf(BOX)
    del file.header["accessors"][0]["bufferView"]
    file.primitive["extensions"] = {"KHR_draco_mesh_compression": {}}
    with pytest.raises(UserError, match="no coordinates .* KHR_draco_mesh_compression"):
        load_surface(file.written(tmp_path / "box.glb"))


def test_data_that_are_in_an_extension_alone_are_refused(tmp_path):
    file = gltf(BOX)
    file.header["buffers"].append({"byteLength": 96})
    view = file.header["bufferViews"][0]
    view |= {"buffer": 1, "byteOffset": 0, "extensions": {"EXT_meshopt_compression": {}}}
    with pytest.raises(UserError, match="data in EXT_meshopt_compression alone"):
        load_surface(file.written(tmp_path / "box.glb"))


@pytest.mark.parametrize(
    ("node", "mesh", "sentence"),
    [
        ({"skin": 0}, {}, "is bent by a skeleton, .* export it without skin"),
        ({}, {"weights": [1.0]}, "is mixed from morph targets, .* export it as it is seen"),
        ({"weights": [0.5]}, {"weights": [0.0]}, "is mixed from morph targets"),
    ],
)
def test_a_mesh_that_something_deforms_is_refused(tmp_path, node, mesh, sentence):
    file = gltf(BOX)
    file.header["nodes"][0] |= node
    file.header["meshes"][0] |= mesh
    with pytest.raises(UserError, match=sentence):
        load_surface(file.written(tmp_path / "box.glb"))


def test_morph_targets_that_have_no_weight_do_not_matter(tmp_path):
    file = gltf(BOX)
    file.header["nodes"][0] |= {"weights": [0.0]}
    file.header["meshes"][0] |= {"weights": [1.0]}
    assert same_triangles(load_surface(file.written(tmp_path / "box.glb")), BOX, 1e-7)


def test_an_accessor_beyond_its_data_is_refused(tmp_path):
    file, _ = quantised(5122, True, 8)
    file.header["accessors"][0]["count"] = 9
    with pytest.raises(UserError, match="could not be read as a mesh .an accessor reaches"):
        load_surface(file.written(tmp_path / "box.glb"))


# STL and PLY --------------------------------------------------------------------------------------

BALL = trimesh.creation.icosphere(subdivisions=1)


def exported(surface, path, **how):
    """Content of a file of the surface, which is written to `path` in full."""
    content = surface.export(file_type=how.pop("file_type", path.suffix[1:]), **how)
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    assert len(load_surface(str(path)).faces) == len(surface.faces)
    return path.read_bytes()


@pytest.mark.parametrize("share", [0.3, 0.9, 0.999])
@pytest.mark.parametrize("head", [bytes(80), b"solid of a program".ljust(80)])
def test_a_binary_stl_file_that_ends_early_says_how_much_of_it_is_there(tmp_path, share, head):
    path = tmp_path / "ball.stl"
    content = head + exported(BALL, path)[80:]
    path.write_bytes(content)
    assert len(load_surface(str(path)).faces) == 80
    path.write_bytes(content[: int(share * len(content))])
    there = (int(share * len(content)) - 84) // 50
    with pytest.raises(UserError, match=f"shorter than its header says, {there} of 80 triangles"):
        load_surface(str(path))


@pytest.mark.parametrize("share", [0.3, 0.9, 0.999])
def test_an_stl_file_of_text_that_ends_early_says_so(tmp_path, share):
    path = tmp_path / "ball.stl"
    content = exported(BALL, path, file_type="stl_ascii")
    path.write_bytes(content[: int(share * len(content))])
    with pytest.raises(UserError, match="ends within a solid, after .* triangles; export or copy"):
        load_surface(str(path))


@pytest.mark.parametrize("end", ["endsolid", "endsolid box facet", "end solid box", "\r"])
def test_an_stl_file_of_text_is_read_whole_however_it_ends(tmp_path, end):
    path = tmp_path / "box.stl"
    lines = exported(BOX, path, file_type="stl_ascii").strip().splitlines()
    text = b"\r".join(lines) if end == "\r" else b"\n".join([*lines[:-1], end.encode()])
    path.write_bytes(b"\xef\xbb\xbf" + text)
    assert load_surface(str(path)).volume == pytest.approx(0.004)


@pytest.mark.parametrize("share", [0.2, 0.55, 0.9])
def test_a_second_solid_that_ends_early_is_seen(tmp_path, share):
    path = tmp_path / "two.stl"
    content = exported(BOX, path, file_type="stl_ascii")
    path.write_bytes(content + b"\n" + content[: int(share * len(content))])
    with pytest.raises(UserError, match="ends within a solid, after"):
        load_surface(str(path))


@pytest.mark.parametrize("more", [1, 49])
def test_a_few_bytes_after_an_stl_file_do_not_matter(tmp_path, more):
    path = tmp_path / "box.stl"
    path.write_bytes(exported(BOX, path) + bytes(more))
    assert load_surface(str(path)).volume == pytest.approx(0.004)


@pytest.mark.parametrize("count", [0, 6])
def test_a_header_that_counts_too_few_triangles_is_refused(tmp_path, count):
    path = tmp_path / "box.stl"
    content = exported(BOX, path)
    path.write_bytes(content[:80] + count.to_bytes(4, "little") + content[84:])
    with pytest.raises(UserError, match=f"says {count} triangles, and there is room for 12"):
        load_surface(str(path))


def test_a_ply_file_of_text_that_ends_early_says_how_much_of_it_is_there(tmp_path):
    path = tmp_path / "ball.ply"
    lines = exported(BALL, path, encoding="ascii").splitlines(keepends=True)
    path.write_bytes(b"".join(lines[:-7]))
    with pytest.raises(UserError, match="shorter than its header says, 73 of 80 faces"):
        load_surface(str(path))
    path.write_bytes(b"".join(lines).rsplit(maxsplit=1)[0])
    with pytest.raises(UserError, match="79 of 80 faces"):
        load_surface(str(path))
    path.write_bytes(b"".join(lines[:-81]))
    with pytest.raises(UserError, match="41 of 42 vertices"):
        load_surface(str(path))


def test_a_binary_ply_file_of_triangles_and_squares_says_what_is_not_read(tmp_path):
    path = tmp_path / "mixed.ply"
    triangles = BOX.faces[:-2].tolist()
    square = [*BOX.faces[-2], next(each for each in BOX.faces[-1] if each not in BOX.faces[-2])]
    header = (
        "ply\nformat binary_little_endian 1.0\nelement vertex 8\nproperty float x\n"
        f"property float y\nproperty float z\nelement face {len(triangles) + 1}\n"
        "property list uchar int vertex_indices\nend_header\n"
    )
    rows = b"".join(
        bytes([len(each)]) + np.array(each, dtype="<i4").tobytes() for each in [*triangles, square]
    )
    path.write_bytes(header.encode() + BOX.vertices.astype("<f4").tobytes() + rows)
    with pytest.raises(UserError, match="different numbers of corners, which are read from text"):
        load_surface(str(path))


@pytest.mark.parametrize("faces", ["", "element face 0\nproperty list uchar int vertex_indices\n"])
def test_a_ply_file_of_triangle_strips_is_refused_as_such(tmp_path, faces):
    rows = "\n".join(" ".join(map(str, row)) for row in BOX.vertices)
    path = tmp_path / "strips.ply"
    path.write_text(
        "ply\nformat ascii 1.0\nelement vertex 8\nproperty double x\nproperty double y\n"
        f"property double z\n{faces}element tristrips 1\nproperty list int int vertex_indices\n"
        f"end_header\n{rows}\n14 3 2 7 6 4 2 0 3 1 7 5 4 1 0\n"
    )
    with pytest.raises(UserError, match="triangle strips, which are not read; export triangles"):
        load_surface(str(path))


# Units --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("ending", ["obj", "ply", "stl", "off", "glb"])
def test_a_mesh_in_millimetres_is_told_to_be_metres_long(tmp_path, caplog, ending):
    """Once, however often its solid is made."""
    path = tmp_path / f"{tmp_path.name}.{ending}"
    block((0, 0, 0), (400, 100, 100)).export(path)
    for _ in range(2):
        assert build_problem(ProblemOptions(str(path), 8)).extents == (400.0, 100.0, 100.0)
    (said,) = [record.message for record in caplog.records]
    assert "400 m long" in said and "--unit mm) it is 40 cm" in said
    caplog.clear()
    build_problem(ProblemOptions(str(path), 8, unit=0.001))
    assert not caplog.records


def test_a_mesh_in_metres_is_not_taken_for_millimetres(tmp_path, caplog):
    path = tmp_path / f"{tmp_path.name}.ply"
    BOX.export(path)
    build_problem(ProblemOptions(str(path), 8))
    assert not caplog.records
    build_problem(ProblemOptions(str(path), 8, unit=0.001))
    (said,) = [record.message for record in caplog.records]
    assert "0.4 mm long" in said and "--unit m) it is 40 cm" in said


def test_what_is_refused_is_refused_in_one_sentence(tmp_path, caplog):
    path = tmp_path / "sheet.ply"
    block((0, 0, 0), (4000, 1000, 1)).export(path)
    with pytest.raises(UserError, match="fills no voxel"):
        build_problem(ProblemOptions(str(path), 8))
    assert not caplog.records
