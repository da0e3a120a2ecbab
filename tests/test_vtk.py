"""VTK, by which ParaView and PyVista read and write, and Carillon read each other's files."""

import numpy as np
import pytest

import carillon as ca
from carillon.fem.geometry.labels import read_labels
from carillon.fem.geometry.volume_files import read_volume_mesh
from solver.response.points import voxel_motion
from tests.volume_meshes import box

vtk = pytest.importorskip("vtk", reason="VTK is not installed (requirements-vtk.txt)")
from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy  # noqa: E402

FORMS = [
    (mode, compressed, wide)
    for mode in ("Ascii", "Binary", "Appended", "AppendedRaw")
    for compressed in (False, True)
    for wide in (False, True)
]


def write(writer, data, path, mode, compressed, wide):
    writer.SetInputData(data)
    writer.SetFileName(str(path))
    getattr(writer, f"SetDataModeTo{mode.removesuffix('Raw')}")()
    writer.SetEncodeAppendedData(mode != "AppendedRaw")
    if compressed:
        writer.SetCompressorTypeToZLib()
        writer.SetBlockSize(1 << 10)
    else:
        writer.SetCompressorTypeToNone()
    writer.SetHeaderTypeToUInt64() if wide else writer.SetHeaderTypeToUInt32()
    assert writer.Write()


def array(values, name):
    made = numpy_to_vtk(values, deep=True)
    made.SetName(name)
    return made


@pytest.mark.parametrize(("mode", "compressed", "wide"), FORMS)
def test_grids_of_vtk_are_read_in_every_form(tmp_path, mode, compressed, wide):
    points, cells = box("tetra", counts=(6, 4, 4))
    grid, places, rows = vtk.vtkUnstructuredGrid(), vtk.vtkPoints(), vtk.vtkCellArray()
    places.SetData(numpy_to_vtk(points, deep=True))
    grid.SetPoints(places)
    ends = 4 * np.arange(len(cells) + 1, dtype=np.int64)
    numbers = (ends, cells.ravel().astype(np.int64))
    rows.SetData(*(numpy_to_vtkIdTypeArray(each, deep=True) for each in numbers))
    grid.SetCells(vtk.VTK_TETRA, rows)
    labels = np.arange(len(cells), dtype=np.int32) % 7
    grid.GetCellData().AddArray(array(labels, "Region"))
    path = tmp_path / "grid.vtu"
    write(vtk.vtkXMLUnstructuredGridWriter(), grid, path, mode, compressed, wide)
    mesh = read_volume_mesh(path)
    np.testing.assert_allclose(mesh.points, points, rtol=1e-6)
    np.testing.assert_array_equal(mesh.blocks[0][1], cells)
    np.testing.assert_array_equal(read_labels(path).values, labels)


@pytest.mark.parametrize(("mode", "compressed", "wide"), FORMS)
def test_images_of_vtk_are_read_in_every_form(tmp_path, mode, compressed, wide):
    image = vtk.vtkImageData()
    image.SetExtent(2, 10, -1, 6, 3, 9)
    image.SetOrigin(0.1, 0.2, 0.3)
    image.SetSpacing(0.01, 0.02, 0.03)
    image.SetDirectionMatrix(0, -1, 0, 1, 0, 0, 0, 0, 1)
    labels = np.arange(image.GetNumberOfCells(), dtype=np.uint16)
    image.GetCellData().AddArray(array(labels, "region"))
    path = tmp_path / "image.vti"
    write(vtk.vtkXMLImageDataWriter(), image, path, mode, compressed, wide)
    middles = []
    for number in range(image.GetNumberOfCells()):
        points = image.GetCell(number).GetPoints()
        middles.append(np.mean([points.GetPoint(k) for k in range(8)], axis=0))
    np.testing.assert_array_equal(read_labels(path).at(np.array(middles)), labels)


@pytest.mark.parametrize("how", [{}, {"discretisation": "finite-cell"}], ids=["voxel", "cell"])
def test_vtk_reads_what_is_written_for_it(tmp_path, how):
    solution = ca.solve("builtin:bar", "two-region", resolution=8, modes=8, **how)
    solution.to_vtu(tmp_path / "bar.vtu")
    reader = vtk.vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(tmp_path / "bar.vtu"))
    reader.Update()
    grid = reader.GetOutput()
    assert grid.GetNumberOfCells() == solution.mesh.n_cells
    assert {grid.GetCellType(k) for k in range(grid.GetNumberOfCells())} == {vtk.VTK_HEXAHEDRON}
    quality = vtk.vtkCellSizeFilter()
    quality.SetInputData(grid)
    quality.Update()
    volumes = vtk_to_numpy(quality.GetOutput().GetCellData().GetArray("Volume"))
    np.testing.assert_allclose(volumes, solution.mesh.edge**3, rtol=1e-6)
    data = grid.GetPointData()
    for number, shape in enumerate(solution.shapes):
        moved = voxel_motion(solution.solid, shape.ravel()).reshape(-1, 3)
        np.testing.assert_allclose(vtk_to_numpy(data.GetArray(number)), moved, rtol=1e-12)
    hertz = vtk_to_numpy(grid.GetFieldData().GetArray("frequencies [Hz]"))
    np.testing.assert_array_equal(hertz, solution.frequencies)
