"""VTU files, which ParaView, PyVista and meshio read: unstructured grids with their arrays.

Arrays follow the XML as they are in memory (appended raw data; VTK file formats, XML), so that
those of many modes are written one after the other, and none is held longer than that.
"""

import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array
from carillon.files.atomic import atomic_path

TYPES = {
    np.dtype(kind): name
    for kind, name in (
        (np.int8, "Int8"),
        (np.uint8, "UInt8"),
        (np.int16, "Int16"),
        (np.uint16, "UInt16"),
        (np.int32, "Int32"),
        (np.uint32, "UInt32"),
        (np.int64, "Int64"),
        (np.uint64, "UInt64"),
        (np.float32, "Float32"),
        (np.float64, "Float64"),
    )
}
"""VTK's names of numbers."""
TRIANGLE, HEXAHEDRON = 5, 12
"""VTK's numbers of the triangle, and of the cube with eight corners."""
HEXAHEDRON_CORNERS = [0, 1, 3, 2, 4, 5, 7, 6]
"""VTK's order of its corners, as numbers of corners in bit order."""
_COUNT = np.dtype(np.uint64)


@dataclass(frozen=True)
class Vectors:
    """Vectors at points, by name; they are made while they are written."""

    names: Sequence[str] = ()
    values: Iterable[Array] = ()
    """An array (p, 3) for each name, in their order."""


@dataclass(frozen=True)
class UnstructuredGrid:
    """Cells of one kind, and what is known of them."""

    points: Array
    """(p, 3) [m]."""
    cells: NDArray[np.integer]
    """(c, k) points of each cell, in VTK's order of its corners."""
    kind: int = HEXAHEDRON
    """VTK's number of the kind of cell."""
    cell_data: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    """(c,) or (c, components) of each array."""
    field_data: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    """(n,) of each array that belongs to the whole."""


def write_vtu(path: str | Path, grid: UnstructuredGrid, vectors: Vectors | None = None) -> None:
    """Write a grid, and vectors at its points.

    Raises UserError if the file cannot be written.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> import meshio
    >>> cube = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], dtype=float)
    >>> grid = UnstructuredGrid(cube, np.array([HEXAHEDRON_CORNERS]))
    >>> with TemporaryDirectory() as folder:
    ...     write_vtu(f"{folder}/cube.vtu", grid, Vectors(["outward"], [cube - 0.5]))
    ...     meshio.read(f"{folder}/cube.vtu").point_data["outward"][7].tolist()
    [0.5, 0.5, 0.5]
    """
    vectors = Vectors() if vectors is None else vectors
    with atomic_path(path) as temporary, open(temporary, "wb") as stream:
        writer = _Writer()
        head = _head(writer, grid, vectors.names)
        stream.write(head.encode())
        for values in writer.arrays:
            _put(stream, values)
        shape = (len(grid.points), 3)
        for _, each in zip(vectors.names, vectors.values, strict=True):
            if each.shape != shape:
                raise ValueError(f"vectors of shape {each.shape}, expected {shape}")
            _put(stream, each)
        stream.write(b"\n  </AppendedData>\n</VTKFile>\n")


class _Writer:
    """Arrays in the order in which they are appended, and tags that say where each begins."""

    def __init__(self) -> None:
        self.arrays: list[NDArray[Any]] = []
        self._offset = 0

    def tag(self, name: str, values: NDArray[Any]) -> str:
        values = np.ascontiguousarray(values)
        self.arrays.append(values)
        return self.announce(name, values.dtype, values.shape)

    def announce(self, name: str, dtype: np.dtype[Any], shape: tuple[int, ...]) -> str:
        """The tag of an array that is appended later."""
        components = f' NumberOfComponents="{shape[1]}"' if len(shape) > 1 else ""
        begin = f"<DataArray type={quoteattr(TYPES[dtype])} Name={quoteattr(name)}{components}"
        offset = self._offset
        self._offset += _COUNT.itemsize + dtype.itemsize * int(np.prod(shape))
        return f'{begin} NumberOfTuples="{shape[0]}" format="appended" offset="{offset}"/>\n'


def _head(writer: _Writer, grid: UnstructuredGrid, names: Sequence[str]) -> str:
    count, corners = grid.cells.shape
    points = np.asarray(grid.points, dtype=float)
    small = len(points) < 2**31 and grid.cells.size < 2**31
    index = np.dtype(np.int32 if small else np.int64)
    offsets = np.arange(corners, corners * (count + 1), corners, dtype=index)
    of_whole = [writer.tag(name, values) for name, values in grid.field_data.items()]
    place = writer.tag("Points", points)
    cells = [
        writer.tag("connectivity", grid.cells.astype(index).ravel()),
        writer.tag("offsets", offsets),
        writer.tag("types", np.full(count, grid.kind, dtype=np.uint8)),
    ]
    of_cells = [writer.tag(name, values) for name, values in grid.cell_data.items()]
    vectors = [writer.announce(name, points.dtype, points.shape) for name in names]
    order = "LittleEndian" if sys.byteorder == "little" else "BigEndian"
    lines = (
        '<?xml version="1.0"?>\n'
        f'<VTKFile type="UnstructuredGrid" version="1.0" byte_order="{order}" '
        'header_type="UInt64">\n',
        "<UnstructuredGrid>\n<FieldData>\n",
        *of_whole,
        f'</FieldData>\n<Piece NumberOfPoints="{len(points)}" NumberOfCells="{count}">\n',
        f"<Points>\n{place}</Points>\n<Cells>\n",
        *cells,
        "</Cells>\n<PointData>\n",
        *vectors,
        "</PointData>\n<CellData>\n",
        *of_cells,
        "</CellData>\n</Piece>\n</UnstructuredGrid>\n",
        '<AppendedData encoding="raw">\n_',
    )
    return "".join(lines)


def _put(stream: BinaryIO, values: NDArray[Any]) -> None:
    contiguous = np.ascontiguousarray(values)
    stream.write(np.array(contiguous.nbytes, dtype=_COUNT).tobytes())
    stream.write(contiguous.data if contiguous.size else b"")
