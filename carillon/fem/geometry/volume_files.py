"""Files of meshes with volume elements: Gmsh, VTK, Abaqus, MED, Medit."""

from __future__ import annotations

import contextlib
import io
import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon.errors import UserError
from carillon.fem.geometry.abaqus_mesh import OTHERS, read_abaqus
from carillon.fem.geometry.cell_shapes import SHAPES
from carillon.fem.geometry.volume_mesh import Block, VolumeMesh
from carillon.files.hdf5 import require_whole_h5
from carillon.files.paths import first_line, require_file
from carillon.files.vtk_xml import VtkFile
from carillon.limits import MESH_BYTES, UNITS, require_within

READERS = {
    "msh": "gmsh",
    "vtu": "",
    "vtk": "vtk",
    "inp": "",
    "med": "med",
    "mesh": "medit",
}
"""meshio's readers by the endings of files; those of .vtu and .inp are in this project. meshio's
knows no bounds of what is decompressed, and stops at the first shell of a mesh for Abaqus."""
_SHAPE_OF_VTK = {shape.vtk: name for name, shape in SHAPES.items()}
_DATASET = re.compile(rb"^\s*DATASET\s+(\w+)", re.MULTILINE | re.IGNORECASE)

Data = dict[str, NDArray[Any]]


def is_volume_file(path: str | Path) -> bool:
    """Whether a name ends as those of meshes with volume elements."""
    return Path(path).suffix.lstrip(".").lower() in READERS


def read_volume_mesh(path: str | Path, unit: float = 1.0) -> VolumeMesh:
    """The volume elements of a file, with their data and the names of their parts.

    Elements of fewer dimensions are left out. Raises UserError if the file is missing, longer than
    `MESH_BYTES`, unreadable, or names other files; if it has no volume elements, or those name
    points that are not there, or have coordinates that are not finite. `unit`: metres per unit.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> nodes = "*NODE", "1,0,0,0", "2,1,0,0", "3,0,1,0", "4,0,0,1"
    >>> with TemporaryDirectory() as folder, open(f"{folder}/one.inp", "w") as file:
    ...     for line in (*nodes, "*ELEMENT, TYPE=C3D4", "1,1,2,3,4"):
    ...         print(line, file=file, flush=True)
    ...     mesh = read_volume_mesh(f"{folder}/one.inp", unit=3.0)
    >>> mesh.n_cells, round(mesh.surface.volume, 9)
    (1, 4.5)
    """
    path = require_file(path, f"a mesh ({', '.join(READERS)})")
    require_within(f"unit {unit:g} m", unit, UNITS)
    if not is_volume_file(path):
        raise UserError(
            f"{path}: ends in {path.suffix or 'nothing'}, expected a mesh of volume elements: "
            f"{', '.join(READERS)}"
        )
    size = path.stat().st_size
    if size > MESH_BYTES:
        raise UserError(
            f"{path}: {size:,} bytes, expected at most {MESH_BYTES:,}; coarsen the mesh"
        )
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            points, blocks, data, names = _contents(path)
            _require_elements(points, blocks)
    except UserError:
        raise
    except Exception as error:  # readers of many formats raise anything
        reason = first_line(error) or type(error).__name__
        raise UserError(
            f"{path}: could not be read as a mesh ({reason}); check or export the file again"
        ) from None
    if not blocks:
        raise UserError(
            f"{path}: has no volume elements, expected {', '.join(SHAPES)}; mesh the inside of the "
            "solid, or export its surface as STL"
        )
    return VolumeMesh(str(path), points * unit, blocks, data, names)


def _contents(path: Path) -> tuple[NDArray[Any], list[Block], Data, dict[int, str]]:
    if path.suffix.lower() == ".vtu":
        return *_of_vtu(path.read_bytes()), {}
    if path.suffix.lower() == ".inp":
        mesh = read_abaqus(path.read_text(encoding="latin-1"))
        data: Data = {"sets": mesh.labels} if mesh.names else {}
        return mesh.points, _joined(mesh.blocks, data), data, mesh.names
    return _of_meshio(path)


def _require_elements(points: NDArray[Any], blocks: list[Block]) -> None:
    if points.ndim != 2 or points.shape[1] != 3:
        raise ValueError("its points do not have three coordinates")
    for name, cells in blocks:
        if cells.ndim != 2 or cells.shape[1] != SHAPES[name].nodes:
            raise ValueError(f"an element {name} does not have {SHAPES[name].nodes} points")
        if cells.size and not 0 <= cells.min() <= cells.max() < len(points):
            raise ValueError(
                f"an element {name} names point {cells.max():,}, there are 0 to {len(points) - 1:,}"
            )
        strange = ~np.isfinite(points[np.unique(cells)]).all(axis=1)
        if strange.any():
            raise ValueError(f"{np.count_nonzero(strange):,} points are not finite")


def _of_vtu(content: bytes) -> tuple[NDArray[Any], list[Block], Data]:
    file = VtkFile.of_content(content, "UnstructuredGrid")
    n_points, n_cells = file.number("NumberOfPoints"), file.number("NumberOfCells")
    (place,) = file.sections("Points").values()
    points = file.array(place, n_points).astype(float)
    tags = file.sections("Cells")
    kinds = file.array(tags["types"], n_cells)
    ends = file.array(tags["offsets"], n_cells).astype(np.int64)
    total = int(ends[-1]) if n_cells else 0
    connectivity = file.array(tags["connectivity"], total).astype(np.int64)
    if np.any(np.diff(ends, prepend=0) < 0):
        raise ValueError("the offsets of its cells do not ascend")
    blocks: list[Block] = []
    chosen = []
    for kind in np.unique(kinds):
        name = _SHAPE_OF_VTK.get(int(kind))
        if name is None:
            continue
        own = np.flatnonzero(kinds == kind)
        nodes = SHAPES[name].nodes
        begin = ends[own] - nodes
        if (np.diff(ends, prepend=0)[own] != nodes).any():
            raise ValueError(f"an element {name} does not have {nodes} points")
        blocks.append((name, connectivity[begin[:, None] + np.arange(nodes)]))
        chosen.append(own)
    order = np.concatenate(chosen) if chosen else np.empty(0, dtype=np.int64)
    arrays = {
        name: file.array(tag, n_cells)[order] for name, tag in file.sections("CellData").items()
    }
    return points, blocks, {name: each for name, each in arrays.items() if each.ndim == 1}


def _of_meshio(path: Path) -> tuple[NDArray[Any], list[Block], Data, dict[int, str]]:
    from importlib import import_module

    _require_by_itself(path)
    reader = import_module(f"meshio.{READERS[path.suffix.lstrip('.').lower()]}")
    # It prints what it does not know.
    with contextlib.redirect_stderr(io.StringIO()), contextlib.redirect_stdout(io.StringIO()):
        mesh = reader.read(str(path))
    points = np.asarray(mesh.points)
    size = path.stat().st_size
    # A number takes a byte at least: what is more was never in the file.
    if points.size + sum(block.data.size for block in mesh.cells) > size:
        raise ValueError("it is shorter than the numbers of points and elements that it says")
    chosen = [number for number, block in enumerate(mesh.cells) if block.type in SHAPES]
    blocks = [(mesh.cells[k].type, np.asarray(mesh.cells[k].data, dtype=np.int64)) for k in chosen]
    data: Data = {}
    for name, values in mesh.cell_data.items():
        arrays = [np.asarray(values[number]) for number in chosen]
        if arrays and all(each.shape == (len(b[1]),) for each, b in zip(arrays, blocks)):
            data[name] = np.concatenate(arrays)
    names = _names(mesh.field_data)
    families = getattr(mesh, "cell_tags", None)
    if families and "cell_tags" in data:
        data["cell_tags"], names = _of_families(data["cell_tags"], families)
    return points.astype(float), _joined(blocks, data), data, names


def _joined(blocks: list[Block], data: Data) -> list[Block]:
    """Blocks of one kind as one, their elements' data in the same order: files have thousands."""
    kinds = list(dict.fromkeys(name for name, _ in blocks))
    starts = np.cumsum([0, *(len(cells) for _, cells in blocks)])
    order = [
        np.arange(start, start + len(cells))
        for kind in kinds
        for start, (name, cells) in zip(starts, blocks)
        if name == kind
    ]
    if order:
        for name, values in data.items():
            data[name] = values[np.concatenate(order)]
    return [(kind, np.concatenate([c for name, c in blocks if name == kind])) for kind in kinds]


def _names(field_data: dict[str, Any]) -> dict[int, str]:
    """Names of Gmsh's physical volumes by their tags."""
    arrays = {name: np.asarray(each).ravel() for name, each in field_data.items()}
    return {
        int(each[0]): str(name)
        for name, each in arrays.items()
        if len(each) == 2 and each.dtype.kind in "iuf" and each[1] == 3
    }


def _of_families(
    tags: NDArray[Any], families: dict[int, list[str]]
) -> tuple[NDArray[Any], dict[int, str]]:
    """Labels of elements by the groups of their families of MED, and 0 of those without."""
    there, number = np.unique(tags, return_inverse=True)
    groups = ["/".join(map(str, families.get(int(tag), []))) for tag in there]
    names = dict(enumerate(sorted(set(groups) - {""}), 1))
    labels = {group: label for label, group in names.items()}
    label = np.array([labels.get(group, 0) for group in groups])
    return label[number.ravel()], names if all(groups) else {0: OTHERS, **names}


def _require_by_itself(path: Path) -> None:
    """Refuse files that name others, and those in which a few bytes stand for any number."""
    kind = path.suffix.lower()
    if kind == ".med":
        require_whole_h5(path)
        return
    dataset = _DATASET.search(path.read_bytes()) if kind == ".vtk" else None
    if dataset is not None and dataset[1].upper() != b"UNSTRUCTURED_GRID":
        raise UserError(
            f"{path}: holds {dataset[1].decode()}, expected UNSTRUCTURED_GRID; save images as .vti"
        )
