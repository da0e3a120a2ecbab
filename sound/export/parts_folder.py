"""A folder of the parts of a design that was built: STL, 3MF, a table and a file of regions."""

from __future__ import annotations

import csv
import io
import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from carillon import __version__
from carillon.arrays import Array, Index
from carillon.composition.materials import MATERIALS
from sound.export.parts import MILLIMETRES, SOLID, BuiltPart, BuiltParts, built_parts, materials_of
from sound.export.placing import FileTable, filling
from sound.export.threemf import ColouredPart, write_3mf
from sound.project.design import Design

ALL, WHOLE, REGIONS = "parts.3mf", f"{SOLID}.stl", "regions.yaml"
"""Names of the files of all parts, of the solid that they make, and of the regions."""
TABLES = ("parts.csv", "parts.json")
"""Names of the tables."""
PARTS = FileTable(
    "parts.json",
    "carillon parts 1",
    re.compile(r"[a-z0-9_]+\.stl|parts\.(3mf|csv|json)|regions\.yaml"),
)
"""How an export knows its files."""
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
class WrittenParts:
    """Rows of the parts and names of the files that were written, and whether they are clipped.

    `removed` are files of a former export that this one has not written again.
    """

    rows: list[dict[str, Any]]
    files: list[str]
    is_clipped: bool
    removed: list[str]


def write_parts(path: str | Path, design: Design) -> WrittenParts:
    """Fill a folder, made if it is missing: an STL file for each material and of the solid, a 3MF
    file, tables and regions.

    Lengths are millimetres, in the axes of the design. `carillon modes` reads `solid.stl` with
    `regions.yaml`. Once all are written, files of a former export, which its `parts.json` lists,
    are removed or replaced; others stay. Raises UserError if the design was not built, its parts
    are thinner than can be printed, or the folder cannot be written, and leaves the folder as it is
    then.
    """
    made = built_parts(design)
    rows = [part.row() for part in made.parts]
    files = [*(part.file for part in made.parts), WHOLE, ALL, REGIONS, *TABLES]
    with filling(path, PARTS, files) as folder:
        _write_all(folder.staged, design, made, files)
        removed = folder.place(files)
    return WrittenParts(rows, files, made.is_clipped, removed)


def _write_all(folder: Path, design: Design, made: BuiltParts, files: list[str]) -> None:
    for part in made.parts:
        _write_stl(folder / part.file, part.vertices, part.faces)
    _write_stl(folder / WHOLE, made.vertices, made.faces)
    coloured = [
        ColouredPart(part.name, MILLIMETRES * part.vertices, part.faces, part.colour)
        for part in made.parts
    ]
    write_3mf(folder / ALL, coloured)
    rows = [part.row() for part in made.parts]
    texts = (
        regions_text(design, made.parts),
        _csv(rows),
        _json(design, rows, made.is_clipped, files),
    )
    for name, text in zip((REGIONS, *TABLES), texts, strict=True):
        (folder / name).write_text(text, encoding="utf-8")


def _write_stl(path: Path, vertices: Array, faces: Index) -> None:
    import trimesh

    surface = trimesh.Trimesh(MILLIMETRES * vertices, faces, process=False)
    content: Any = surface.export(file_type="stl")
    path.write_bytes(content)


def regions_text(design: Design, parts: list[BuiltPart]) -> str:
    """A file of regions, each a part, as `carillon modes` reads them."""
    told = {str(each["name"]): each for each in materials_of(design)}
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


def _json(design: Design, rows: list[dict[str, Any]], is_clipped: bool, files: list[str]) -> str:
    content = {
        "format": PARTS.format,
        "generator": f"Carillon {__version__}",
        "name": design.name,
        "unit": "mm",
        "surfaces": "cut by the solid's surface" if is_clipped else "faces of voxels",
        "voxel_mm": MILLIMETRES * design.fine_edge,
        "units": UNITS,
        "parts": rows,
        "files": files,
    }
    return json.dumps(content, indent=1)
