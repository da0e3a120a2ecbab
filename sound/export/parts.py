"""The parts of a design that was built: a closed surface for each of its materials."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import scipy.ndimage as ndi
import yaml

from carillon import __version__
from carillon.arrays import Array, Index, Integers
from carillon.composition.materials import MATERIALS
from carillon.errors import UserError
from carillon.fem.geometry.size import length_in_words
from carillon.files.atomic import atomic_path
from sound.export.names import file_names
from sound.export.threemf import ColouredPart, write_3mf
from sound.export.voxel_surface import voxel_surface
from sound.project.design import Design

MILLIMETRES = 1e3
"""Of a metre."""
THINNEST = 0.4e-3
"""Width [m] of the line of a usual printer, below which nothing can be printed."""
REACH = 2
"""Voxels by which parts are made to go on beyond the voxels, before the surface cuts them."""
LEAST_VOLUME = 1e-9
"""Volume of a piece, over that of its part, below which it is a trace of rounding."""
ALL, WHOLE, TABLE, REGIONS = "parts.3mf", "solid.stl", "parts", "regions.yaml"
"""Names of the files of all parts and of the solid that they make, of the tables without their
endings, and of the regions."""
FORMAT = "carillon parts 1"
UNITS = {
    "volume_mm3": "volume inside the surface, infill and air",
    "mass_g": "mass by density and volume",
    "extents_mm": "sides of the box around it",
    "fraction": "of the volume that is filled, 1 of what is solid",
    "density_kg_per_m3": "mass density, that of the infill with its air",
    "pieces": "that do not touch each other",
}
"""Meaning of the columns."""


@dataclass(frozen=True)
class BuiltPart:
    """All of a design that is of one material."""

    name: str
    file: str
    """Name of its STL file."""
    vertices: Array
    faces: Index
    """(v, 3) [m], (f, 3): a closed surface, facing outwards."""
    colour: tuple[float, float, float]
    fraction: float
    density: float
    """Share of its volume that is filled, mass density [kg/m^3]."""
    pieces: int

    @property
    def volume(self) -> float:
        """[m^3]."""
        corners = self.vertices[self.faces]
        return float(np.linalg.det(corners).sum() / 6.0)

    @property
    def extents(self) -> Array:
        """Sides (3,) of the box around it [m]."""
        return np.asarray(np.ptp(self.vertices, axis=0))

    def row(self) -> dict[str, Any]:
        """Its row of the table."""
        return {
            "part": self.file.removesuffix(".stl"),
            "material": self.name,
            "file": self.file,
            "volume_mm3": self.volume * MILLIMETRES**3,
            "mass_g": self.volume * self.density * 1e3,
            "extents_mm": (MILLIMETRES * self.extents).tolist(),
            "fraction": self.fraction,
            "density_kg_per_m3": self.density,
            "pieces": self.pieces,
        }


@dataclass(frozen=True)
class BuiltParts:
    """Parts of a design, and the solid that they make.

    Where `is_clipped`, its surface cuts them; else their faces are those of voxels.
    """

    parts: list[BuiltPart]
    vertices: Array
    faces: Index
    """(v, 3) [m], (f, 3): surface of the solid."""
    is_clipped: bool


@dataclass(frozen=True)
class WrittenParts:
    """Rows of the parts and names of the files that were written, and whether they are clipped."""

    rows: list[dict[str, Any]]
    files: list[str]
    is_clipped: bool


def write_parts(folder: str | Path, design: Design) -> WrittenParts:
    """Write an STL file for each material and of the solid, a 3MF file, tables and regions.

    Lengths are millimetres, in the axes of the design. `carillon modes` reads `solid.stl` with
    `regions.yaml`. Raises UserError if the design was not built, its parts are thinner than can be
    printed, or the folder cannot be written.
    """
    made = built_parts(design)
    folder = Path(folder)
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise UserError(f"{folder}: cannot be made ({error.strerror})") from error
    for part in made.parts:
        _write_stl(folder / part.file, part.vertices, part.faces)
    _write_stl(folder / WHOLE, made.vertices, made.faces)
    coloured = [
        ColouredPart(part.name, MILLIMETRES * part.vertices, part.faces, part.colour)
        for part in made.parts
    ]
    write_3mf(folder / ALL, coloured)
    rows = [part.row() for part in made.parts]
    texts = {
        REGIONS: regions_text(design, made.parts),
        f"{TABLE}.csv": _csv(rows),
        f"{TABLE}.json": _json(design, rows, made.is_clipped),
    }
    for name, text in texts.items():
        with atomic_path(folder / name) as temporary:
            temporary.write_text(text, encoding="utf-8")
    files = [*(part.file for part in made.parts), WHOLE, ALL, *texts]
    return WrittenParts(rows, files, made.is_clipped)


def built_parts(design: Design) -> BuiltParts:
    """Parts of a design that was built, cut by its surface if manifold3d is there to do it.

    Raises UserError if the design was not built, or its parts are thinner than can be printed.
    """
    told = _told(design)
    labels = _labels(design)
    origin = design.fine_origin + design.fine_edge * (design.fine_grid.min(axis=0) - REACH)
    vertices, faces = voxel_surface(labels >= 0)
    whole = origin + design.fine_edge * vertices, faces
    cutter = _cutter(design)
    if cutter is not None:
        # What the voxels leave out below the surface is of the nearest one.
        distance, nearest = ndi.distance_transform_edt(labels < 0, return_indices=True)
        labels = np.where(distance <= np.sqrt(3.0) * REACH, labels[tuple(nearest)], -1)
        whole = design.surface_vertices, np.asarray(design.surface_faces, dtype=np.int64)
    numbers = [number for number in range(len(told)) if (labels == number).any()]
    names = file_names([str(told[number]["name"]) for number in numbers])
    parts = []
    for number, name in zip(numbers, names, strict=True):
        vertices, faces = voxel_surface(labels == number)
        vertices = origin + design.fine_edge * vertices
        if cutter is not None:
            vertices, faces = _clipped(vertices, faces, cutter)
        if len(faces):
            parts.append(_part(told[number], f"{name}.stl", vertices, faces))
    return BuiltParts(parts, *whole, cutter is not None)


def _part(told: Mapping[str, Any], file: str, vertices: Array, faces: Index) -> BuiltPart:
    red, green, blue = map(float, told["colour"])
    density, fraction = float(told["density_kg_per_m3"]), float(told["fraction"])
    pieces = _pieces(faces)
    colour = red, green, blue
    return BuiltPart(str(told["name"]), file, vertices, faces, colour, fraction, density, pieces)


def _told(design: Design) -> list[Mapping[str, Any]]:
    """Entries of the materials of a design, in the order of its table."""
    build = design.evidence.get("build")
    if not build or design.fine_region is None:
        raise UserError(
            "the design is a continuous field, which has no parts; name real materials below build "
            "in its project, and design again"
        )
    width = build.get("at_least_m")
    if width is not None and width < THINNEST:
        raise UserError(
            f"build.at_least: parts are as thin as {length_in_words(width)}, expected "
            f"{length_in_words(THINNEST)} or more, the width of a printer's line; set it, or a "
            "lower resolution"
        )
    told: list[Mapping[str, Any]] = build["materials"]
    return told


def _labels(design: Design) -> Array:
    """Number of the material of each voxel of a grid with `REACH` voxels of air around; air is
    -1."""
    assert design.fine_region is not None
    shape = np.ptp(design.fine_grid, axis=0) + 1 + 2 * REACH
    labels = np.full(shape, -1)
    labels[tuple((design.fine_grid - design.fine_grid.min(axis=0) + REACH).T)] = design.fine_region
    return labels


def _cutter(design: Design) -> Any:
    """The inside of a design's surface as manifold3d has it; None if it cannot."""
    if find_spec("manifold3d") is None:
        return None
    made = _manifold(design.surface_vertices, design.surface_faces)
    return None if made.is_empty() else made


def _manifold(vertices: Array, faces: Integers) -> Any:
    import manifold3d
    import trimesh

    surface = trimesh.Trimesh(vertices, faces, process=False)
    surface.merge_vertices()
    mesh = manifold3d.Mesh64(
        np.asarray(surface.vertices, np.float64), np.asarray(surface.faces, np.uint64)
    )
    return manifold3d.Manifold(mesh)


def _clipped(vertices: Array, faces: Index, cutter: Any) -> tuple[Array, Index]:
    """The part of a surface inside of another one, without crumbs of rounding."""
    import manifold3d

    common = _manifold(vertices, faces) ^ cutter
    pieces = common.decompose()
    least = LEAST_VOLUME * max((each.volume() for each in pieces), default=0.0)
    kept = [each for each in pieces if each.volume() > least]
    if not kept:
        return np.empty((0, 3)), np.empty((0, 3), dtype=np.int64)
    mesh = manifold3d.Manifold.compose(kept).to_mesh64()
    return np.asarray(mesh.vert_properties[:, :3], float), np.asarray(mesh.tri_verts, np.int64)


def _pieces(faces: Index) -> int:
    import scipy.sparse as sp

    count = int(faces.max()) + 1
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
    links = sp.coo_matrix((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(count, count))
    return int(sp.csgraph.connected_components(links, directed=False)[0])


def _write_stl(path: Path, vertices: Array, faces: Index) -> None:
    import trimesh

    surface = trimesh.Trimesh(MILLIMETRES * vertices, faces, process=False)
    content: Any = surface.export(file_type="stl")
    with atomic_path(path) as temporary:
        temporary.write_bytes(content)


def regions_text(design: Design, parts: list[BuiltPart]) -> str:
    """A file of regions, each a part, as `carillon modes` reads them."""
    told = {str(each["name"]): each for each in _told(design)}
    own = {each["name"]: each for each in design.settings["build"].get("own_materials", ())}
    entries = []
    for part in parts:
        if part.name in own:
            given = {key: value for key, value in own[part.name].items() if value is not None}
        elif part.name in MATERIALS:
            given = {"material": part.name}
        else:
            each = told[part.name]
            given = {
                "young": each["young_pa"],
                "poisson": each["poisson"],
                "density": each["density_kg_per_m3"],
            }
        place = {"mesh": ALL, "part": part.name, "unit": "mm"}
        entries.append({**given, "name": part.name, **place})
    return yaml.safe_dump({"regions": entries}, sort_keys=False, allow_unicode=True)


def _csv(rows: list[dict[str, Any]]) -> str:
    content = io.StringIO()
    table = csv.writer(content, lineterminator="\n")
    sides = ["x_mm", "y_mm", "z_mm"]
    keys = [key for key in rows[0] if key != "extents_mm"]
    table.writerow([*keys, *sides])
    for row in rows:
        numbers = [*(row[key] for key in keys), *row["extents_mm"]]
        table.writerow([f"{each:.9g}" if isinstance(each, float) else each for each in numbers])
    return content.getvalue()


def _json(design: Design, rows: list[dict[str, Any]], is_clipped: bool) -> str:
    content = {
        "format": FORMAT,
        "generator": f"Carillon {__version__}",
        "name": design.name,
        "unit": "mm",
        "surfaces": "cut by the solid's surface" if is_clipped else "faces of voxels",
        "voxel_mm": MILLIMETRES * design.fine_edge,
        "units": UNITS,
        "parts": rows,
    }
    return json.dumps(content, indent=1)
