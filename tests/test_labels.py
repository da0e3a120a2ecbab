"""Files of other programs say what parts and moduli a solid has, wherever a point lies."""

import struct
import zlib

import h5py
import meshio
import numpy as np
import pytest

import carillon as ca
from carillon.errors import UserError
from carillon.fem.geometry import load_surface
from carillon.fem.geometry.cell_shapes import SHAPES
from carillon.fem.geometry.labels import read_cell_moduli, read_labels
from carillon.fem.geometry.volume_files import read_volume_mesh
from carillon.fem.materials import young_modulus
from tests.volume_meshes import box, write

SIDES = np.array([0.3, 0.2, 0.1])
FORMS = {
    "msh22": ("msh", {"file_format": "gmsh22"}),
    "msh22 text": ("msh", {"file_format": "gmsh22", "binary": False}),
    "msh41": ("msh", {"file_format": "gmsh"}),
    "msh41 text": ("msh", {"file_format": "gmsh", "binary": False}),
    "vtu": ("vtu", {}),
    "vtu plain": ("vtu", {"compression": None}),
    "vtu text": ("vtu", {"binary": False}),
    "vtk": ("vtk", {"file_format": "vtk42"}),
    "vtk text": ("vtk", {"file_format": "vtk42", "binary": False}),
    "vtk51": ("vtk", {"file_format": "vtk51"}),
    "inp": ("inp", {}),
    "med": ("med", {}),
    "mesh": ("mesh", {}),
}
ARRAYS = {"msh": "gmsh:physical", "med": "cell_tags", "mesh": "medit:ref"}


def middles(points, cells):
    return points[cells].mean(axis=1)


def written(folder, form, name="tetra"):
    """A box of two parts in a file; its label is 1 left and 2 right, the modulus 1 and 3 GPa."""
    ending, how = FORMS[form]
    points, cells = box(name, counts=(4, 2, 2))
    right = middles(points, cells)[:, 0] > 0.15
    labels = 1 + right.astype(np.int32)
    order = np.argsort(labels, kind="stable")
    cells, labels = cells[order], labels[order]
    data = {ARRAYS.get(ending, "region"): [labels]}
    if ending == "msh":
        data["gmsh:geometrical"] = [labels]
    if ending in ("vtu", "vtk"):
        data["Young"] = [1e9 * (2.0 * labels - 1.0)]
    blocks = [(name, cells)]
    if form.startswith("msh41"):
        count = np.count_nonzero(labels == 1)
        blocks = [(name, cells[:count]), (name, cells[count:])]
        data = {array: [each[:count], each[count:]] for array, (each,) in data.items()}
    mesh = meshio.Mesh(points, blocks, cell_data=data)
    if ending == "msh":
        # The volumes that the nodes lie in, of which there are two: left and right.
        last = np.zeros(len(points), dtype=int)
        last[cells.ravel()] = np.repeat(labels, cells.shape[1])
        mesh.point_data = {"gmsh:dim_tags": np.stack([np.full_like(last, 3), last], axis=1)}
        mesh.field_data = {"left": np.array([1, 3]), "right": np.array([2, 3])}
        mesh.field_data["skin"] = np.array([1, 2])
    if ending == "inp":
        mesh.cell_data = {}
        parts = [np.flatnonzero(labels == label) for label in (1, 2)]
        mesh.cell_sets = {"left": [parts[0]], "right": [parts[1]]}
    path = folder / f"box.{ending}"
    mesh.write(path, **how)
    return path


@pytest.mark.parametrize("form", FORMS)
def test_a_file_is_its_solid_and_tells_the_part_of_every_point(tmp_path, form):
    path = written(tmp_path, form)
    surface = load_surface(str(path), unit=2.0)
    assert surface.is_watertight and surface.volume == pytest.approx(8.0 * SIDES.prod(), rel=1e-6)
    labels = read_labels(path, unit=2.0)
    points = 2.0 * SIDES * np.random.default_rng(0).random((500, 3))
    expected = np.where(points[:, 0] < 0.3, 1, 2)
    # The middle is a face between the parts to the file's digits.
    clear = abs(points[:, 0] - 0.3) > 1e-6
    np.testing.assert_array_equal(labels.at(points)[clear], expected[clear])
    assert labels.at(np.array([[-0.1, 0.1, 0.1]])).tolist() == [-1]
    assert labels.at(np.array([[-0.1, 0.1, 0.1], [0.9, 0.1, 0.1]]), nearest=True).tolist() == [1, 2]
    named = form.startswith(("msh", "inp"))
    assert labels.names == ({1: "left", 2: "right"} if named else {1: "1", 2: "2"})


@pytest.mark.parametrize("form", ["vtu", "vtk", "msh41"])
@pytest.mark.parametrize("name", ["hexahedron", "wedge", "tetra10", "hexahedron20", "pyramid"])
def test_elements_of_every_kind_are_read(tmp_path, form, name):
    path = written(tmp_path, form, name)
    mesh = read_volume_mesh(path)
    assert mesh.blocks[0][0] == name
    assert mesh.surface.volume == pytest.approx(SIDES.prod())


def test_elements_of_several_kinds_keep_their_data(tmp_path):
    """A file may have them in any order, and elements of fewer dimensions between them."""
    points, blocks, data, count = [], [], [], 0
    for number, name in enumerate(("tetra", "triangle", "hexahedron", "tetra", "wedge")):
        own, cells = box("tetra" if name == "triangle" else name)
        points.append(own + [0.3 * number, 0.0, 0.0])
        blocks.append((name, (cells[:, :3] if name == "triangle" else cells) + count))
        data.append(np.full(len(cells), number, dtype=np.int32))
        count += len(own)
    for form in ("vtu", "msh"):
        named = {"region": data} if form == "vtu" else {"gmsh:physical": data}
        if form == "msh":
            named["gmsh:geometrical"] = data
        path = tmp_path / f"several.{form}"
        how = {} if form == "vtu" else {"file_format": "gmsh22"}
        meshio.Mesh(np.concatenate(points), blocks, cell_data=named).write(path, **how)
        at = np.array([[0.3 * number + 0.16, 0.09, 0.04] for number in range(5)])
        assert read_labels(path).at(at).tolist() == [0, -1, 2, 3, 4]


def test_a_mesh_of_tetrahedra_has_the_spectrum_of_its_surface(tmp_path):
    path = written(tmp_path, "msh41")
    load_surface(str(path)).export(tmp_path / "surface.stl")
    found, expected = (
        ca.solve(tmp_path / name, resolution=12, modes=10).frequencies[6:]
        for name in ("box.msh", "surface.stl")
    )
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_moduli_of_elements_are_those_of_the_voxels_in_them(tmp_path):
    path = written(tmp_path, "vtu")
    mesh = ca.load_mesh(path).hexahedra(12)
    young = ca.Material(str(path)).moduli(mesh)
    middle = (mesh.origin + mesh.edge * (mesh.grid + 0.5))[:, 0]
    np.testing.assert_array_equal(young, np.where(middle < 0.15, 1e9, 3e9))


def test_moduli_come_back_from_what_is_written_for_paraview(tmp_path):
    """Through a file of hexahedra, on another mesh of voxels than theirs."""
    solution = ca.solve("builtin:bar", "two-region", resolution=12, modes=7)
    solution.to_vtu(tmp_path / "bar.vtu")
    again = ca.solve("builtin:bar", str(tmp_path / "bar.vtu"), resolution=12, modes=7)
    np.testing.assert_array_equal(again.solid.young, solution.solid.young)
    np.testing.assert_allclose(
        load_surface(str(tmp_path / "bar.vtu")).bounds, solution.mesh.bounds, atol=1e-12
    )


def test_moduli_of_another_place_are_refused(tmp_path):
    path = written(tmp_path, "vtu")
    for unit, sentence in ((4.0, "voxels lie outside its cells"), (0.001, "its cells measure 0.3")):
        with pytest.raises(UserError, match=f"{sentence}.*unit"):
            ca.Material(str(path)).moduli(ca.load_mesh(path, unit=unit).hexahedra(8))
    millimetres = ca.load_mesh(path, unit=0.001).hexahedra(8)
    young = young_modulus(str(path), millimetres, unit=0.001)
    np.testing.assert_array_equal(np.unique(young), [1e9, 3e9])


# Grids --------------------------------------------------------------------------------------------


def image(form, data="CellData", direction=""):
    """A VTI file of 3 x 2 x 1 boxes (points with `PointData`) with labels 0 to 5, x fastest."""
    values = np.arange(6, dtype="<i4")
    text = {"ascii": " ".join(map(str, values)), "appended": ""}
    if form == "binary":
        import base64

        raw = struct.pack("<I", values.nbytes) + values.tobytes()
        text["binary"] = base64.b64encode(raw).decode()
    extent = "2 5 0 2 0 1" if data == "CellData" else "2 4 0 1 0 0"
    tag = (
        f'<DataArray type="Int32" Name="Label" format="{form}" offset="0">{text[form]}</DataArray>'
    )
    compressed = zlib.compress(values.tobytes())
    head = struct.pack("<4Q", 1, values.nbytes, 0, len(compressed))
    compressor = ' compressor="vtkZLibDataCompressor"' if form == "appended" else ""
    appended = b'<AppendedData encoding="raw">_' + head + compressed + b"</AppendedData>"
    start = (
        f'<VTKFile type="ImageData" version="1.0" byte_order="LittleEndian" '
        f'header_type="{"UInt64" if form == "appended" else "UInt32"}"{compressor}>'
        f'<ImageData WholeExtent="{extent}" Origin="1 2 3" Spacing="0.5 1 2"{direction}>'
        f'<Piece Extent="{extent}"><{data}>{tag}</{data}></Piece></ImageData>'
    ).encode()
    return start + (appended if form == "appended" else b"") + b"</VTKFile>"


@pytest.mark.parametrize("form", ["ascii", "binary", "appended"])
def test_an_image_labels_the_boxes_between_its_points(tmp_path, form):
    (tmp_path / "i.vti").write_bytes(image(form))
    labels = read_labels(tmp_path / "i.vti", unit=0.1)
    # Its extent begins at 2: the first box is from x = 2 to 2.5.
    points = 0.1 * np.array([[2.1, 2.5, 4.0], [2.6, 2.5, 4.0], [3.4, 3.9, 3.1], [1.9, 2.5, 4.0]])
    assert labels.at(points).tolist() == [0, 1, 5, -1]
    assert labels.at(points, nearest=True).tolist() == [0, 1, 5, 0]
    ends = 0.1 * np.array([[2.0, 2.0, 3.0], [3.5, 4.0, 5.0]])
    assert labels.at(ends).tolist() == [0, 5]


def test_an_image_with_values_at_points_labels_boxes_around_them(tmp_path):
    (tmp_path / "i.vti").write_bytes(image("ascii", "PointData"))
    labels = read_labels(tmp_path / "i.vti")
    assert labels.at(np.array([[2.2, 2.4, 3.9], [2.3, 2.6, 2.1]])).tolist() == [0, 4]


def test_an_image_may_be_turned(tmp_path):
    turned = ' Direction="0 -1 0 1 0 0 0 0 1"'
    (tmp_path / "i.vti").write_bytes(image("ascii", direction=turned))
    # Along the grid's x is y, along its y is -x; its extent begins two boxes along x.
    place = np.array([1.0, 2.0, 3.0]) + np.array([-1.5, 1.0 + 0.75, 1.0])
    assert read_labels(tmp_path / "i.vti").at(place[None]).tolist() == [4]


def test_an_array_labels_the_box_that_it_fills(tmp_path):
    values = np.arange(24, dtype=np.uint8).reshape(2, 3, 4)
    np.save(tmp_path / "labels.npy", values)
    cell = np.array([1, 2, 3])
    box = np.array([[0.0, 0.0, 0.0], [0.2, 0.3, 0.8]])
    labels = read_labels(tmp_path / "labels.npy", box=box)
    sides = (box[1] - box[0]) / values.shape
    for cell in np.ndindex(values.shape):
        at = box[0] + sides * (np.array(cell) + 0.4)
        assert labels.at(at[None]).tolist() == [values[cell]]
    with pytest.raises(UserError, match="an array has no place"):
        read_labels(tmp_path / "labels.npy")


# Bad input ----------------------------------------------------------------------------------------


def test_an_array_may_be_named_and_a_missing_one_is_told(tmp_path):
    points, cells = box("tetra")
    data = {"Stiff": [np.full(len(cells), 2e9)], "half": [np.full(len(cells), 0.5)]}
    path = write(tmp_path / "b.vtu", points, [("tetra", cells)], data)
    at = np.array([[0.1, 0.1, 0.05]])
    assert read_cell_moduli(path, array="stiff").at(at).tolist() == [2e9]
    with pytest.raises(UserError, match="cells have Stiff, half, expected Young's moduli in one"):
        read_cell_moduli(path)
    with pytest.raises(UserError, match="expected labels in 'part'"):
        read_labels(path, array="part")
    with pytest.raises(UserError, match="its labels are not whole numbers"):
        read_labels(path, array="half")


def bomb():
    """A VTU file of a few kilobytes whose points would take terabytes."""
    return (
        b'<VTKFile type="UnstructuredGrid" version="1.0" header_type="UInt64" '
        b'compressor="vtkZLibDataCompressor"><UnstructuredGrid>'
        b'<Piece NumberOfPoints="100000000000" NumberOfCells="1"><Points><DataArray type="Float64" '
        b'NumberOfComponents="3" format="appended" offset="0"/></Points></Piece></UnstructuredGrid>'
        b'<AppendedData encoding="raw">_</AppendedData></VTKFile>'
    )


def long_block():
    """Blocks that hold more than the header of their array says."""
    zeros = zlib.compress(bytes(10_000_000))
    head = struct.pack("<4Q", 1, 24, 0, len(zeros))
    return (
        b'<VTKFile type="UnstructuredGrid" version="1.0" header_type="UInt64" '
        b'compressor="vtkZLibDataCompressor"><UnstructuredGrid>'
        b'<Piece NumberOfPoints="1" NumberOfCells="0"><Points><DataArray type="Float64" '
        b'NumberOfComponents="3" format="appended" offset="0"/></Points><Cells>'
        b'<DataArray type="UInt8" Name="types" format="ascii"/>'
        b'<DataArray type="Int8" Name="offsets" format="ascii"/>'
        b'<DataArray type="Int8" Name="connectivity" format="ascii"/></Cells></Piece>'
        b'</UnstructuredGrid><AppendedData encoding="raw">_' + head + zeros + b"</AppendedData>"
        b"</VTKFile>"
    )


GMSH = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n"
BAD = {
    "empty.msh": (b"", "could not be read as a mesh"),
    "cut.msh": (GMSH.encode() + b"$Nodes\n4\n1 0 0 0\n", "could not be read as a mesh"),
    "huge.msh": (
        GMSH.encode() + b"$Nodes\n99999999999\n1 0 0 0\n$EndNodes\n",
        "could not be read as a mesh",
    ),
    "bomb.vtu": (bomb(), "would take 2,400,000,000,000 bytes in a file of"),
    "entities.vtu": (b"<!DOCTYPE a [<!ENTITY b 'c'>]><VTKFile/>", "defines entities"),
    "lz4.vtu": (
        b'<VTKFile type="UnstructuredGrid" compressor="vtkLZ4DataCompressor"/>',
        "compressed by vtkLZ4DataCompressor",
    ),
    "surface.vtu": (b'<VTKFile type="PolyData"/>', "expected UnstructuredGrid"),
    "image.vtk": (
        b"# vtk DataFile Version 4.2\n.\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 9999 9999 9",
        "holds STRUCTURED_POINTS, expected UNSTRUCTURED_GRID",
    ),
    "other.inp": (b"*NODE\n1,0,0,0\n*INCLUDE, INPUT=/etc/passwd\n", "includes other files"),
    "text.med": (b"no HDF5", "could not be read as a mesh"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_mesh_is_refused_in_one_sentence(tmp_path, name):
    content, sentence = BAD[name]
    (tmp_path / name).write_bytes(content)
    with pytest.raises(UserError) as raised:
        load_surface(str(tmp_path / name))
    assert sentence in str(raised.value) and "\n" not in str(raised.value)


def test_a_block_is_not_decompressed_beyond_what_the_header_says(tmp_path):
    (tmp_path / "long.vtu").write_bytes(long_block())
    with pytest.raises(UserError, match="has no volume elements"):
        load_surface(str(tmp_path / "long.vtu"))


def test_a_med_file_that_stands_for_more_than_it_holds_is_refused(tmp_path):
    path = written(tmp_path, "med")
    with h5py.File(path, "r+") as file:
        file.create_dataset("never written", (10**12,), float)
    with pytest.raises(UserError, match="never written"):
        load_surface(str(path))


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda points, cells: cells.__setitem__((0, 0), 10**6), "names point 1,000,000"),
        (lambda points, cells: points.__setitem__((0, 0), np.nan), "points are not finite"),
    ],
)
def test_elements_of_no_use_are_told(tmp_path, change, sentence):
    points, cells = box("hexahedron")
    change(points, cells)
    path = tmp_path / "strange.vtu"
    meshio.Mesh(points, [("hexahedron", cells)]).write(path)
    with pytest.raises(UserError, match=sentence):
        load_surface(str(path))


def test_a_mesh_of_triangles_alone_is_told_what_is_missing(tmp_path):
    points, cells = box("tetra")
    path = write(tmp_path / "flat.msh", points, [("triangle", cells[:, :3])], file_format="gmsh22")
    with pytest.raises(UserError, match="has no volume elements, expected tetra"):
        load_surface(path)


def test_all_kinds_are_named():
    assert {"tetra", "tetra10", "hexahedron", "hexahedron20", "hexahedron27"} <= set(SHAPES)


ABAQUS = """*HEADING
a cube in two parts
*NODE, NSET=all
{nodes}
*ELEMENT, TYPE=S3, ELSET=skin
900, 1, 2, 3
*ELEMENT, type=C3D8R, elset=Everything
{elements}
*ELSET, ELSET=Left, GENERATE
{left}
*ELSET, ELSET=Right
Rest,
*ELSET, ELSET=RIGHT
{right}
"""


def abaqus(sections=""):
    points, cells = box("hexahedron", counts=(4, 1, 1))
    nodes = "\n".join(f"{7 * k}, {x}, {y}, {z}" for k, (x, y, z) in enumerate(points.tolist(), 1))
    rows = [", ".join(str(7 * (node + 1)) for node in cell) for cell in cells.tolist()]
    # Elements go on in a second line.
    rows = [
        f"{k}, {row}".replace(", ", ",", 3).replace(",", ",", 1) for k, row in enumerate(rows, 11)
    ]
    rows = [",\n".join([row[: row.index(",", 8)], row[row.index(",", 8) + 1 :]]) for row in rows]
    text = ABAQUS.format(
        nodes=nodes, elements="\n".join(rows), left="11, 12, 1", right="13, 14, 12,"
    )
    return text + sections


def test_sets_of_abaqus_are_parts_the_first_of_an_element(tmp_path):
    path = tmp_path / "a.inp"
    path.write_text(abaqus())
    at = np.array([[0.01, 0.1, 0.05], [0.1, 0.1, 0.05], [0.2, 0.1, 0.05], [0.29, 0.1, 0.05]])
    labels = read_labels(path)
    assert [labels.names[label] for label in labels.at(at)] == ["Left", "Left", "Right", "Right"]
    path.write_text(abaqus("*SOLID SECTION, ELSET=right, MATERIAL=steel\n1.,\n"))
    labels = read_labels(path)
    found = [labels.names[label] for label in labels.at(at)]
    assert found == ["others", "Right", "Right", "Right"]


def test_abaqus_of_several_parts_is_refused(tmp_path):
    path = tmp_path / "a.inp"
    path.write_text("*PART, NAME=a\n*END PART\n*PART, NAME=b\n*END PART\n")
    with pytest.raises(UserError, match="several parts, expected one"):
        load_surface(str(path))
