"""3MF files: parts with names and colours in one archive (3MF core specification 1.2.3).

trimesh writes neither names of materials nor their colours, and needs a package more for what it
writes; a file of triangles is three short texts.
"""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import quoteattr

from carillon.arrays import Array, Index
from carillon.files.atomic import atomic_path

MODEL = "3D/3dmodel.model"
NAMESPACE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
MATERIALS_ID = 1
"""Number of the list of materials; objects follow."""
_TYPES = (
    '<?xml version="1.0" encoding="UTF-8"?>\n'
    '<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">'
    '<Default Extension="rels" '
    'ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
    '<Default Extension="model" '
    'ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>'
)
_RELATIONS = (
    '<?xml version="1.0" encoding="UTF-8"?>\n'
    '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">'
    f'<Relationship Target="/{MODEL}" Id="rel0" '
    'Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>'
)
_DATE = (1980, 1, 1, 0, 0, 0)
"""Of all texts in the archive, whose bytes so depend on the parts alone."""


@dataclass(frozen=True)
class ColouredPart:
    """A closed surface of vertices (v, 3) [mm] and triangles (f, 3), its name and its colour, red,
    green and blue from 0 to 1 (sRGB)."""

    name: str
    vertices: Array
    faces: Index
    colour: Sequence[float]


def write_3mf(path: str | Path, parts: Sequence[ColouredPart]) -> None:
    """Write parts, in millimetres; raises UserError if the file cannot be written."""
    texts = {"[Content_Types].xml": _TYPES, "_rels/.rels": _RELATIONS, MODEL: _model(parts)}
    with atomic_path(path) as temporary, zipfile.ZipFile(temporary, "w") as archive:
        for name, text in texts.items():
            entry = zipfile.ZipInfo(name, _DATE)
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, text)


def _model(parts: Sequence[ColouredPart]) -> str:
    bases = "".join(
        f'<base name={quoteattr(part.name)} displaycolor="{_hex(part.colour)}"/>' for part in parts
    )
    objects = "".join(_object(number, part) for number, part in enumerate(parts))
    items = "".join(
        f'<item objectid="{MATERIALS_ID + 1 + number}"/>' for number in range(len(parts))
    )
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<model unit="millimeter" xml:lang="en-US" xmlns="{NAMESPACE}"><resources>'
        f'<basematerials id="{MATERIALS_ID}">{bases}</basematerials>{objects}</resources>'
        f"<build>{items}</build></model>\n"
    )


def _object(number: int, part: ColouredPart) -> str:
    vertices = "".join(
        f'<vertex x="{x:.7g}" y="{y:.7g}" z="{z:.7g}"/>' for x, y, z in part.vertices.tolist()
    )
    faces = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in part.faces.tolist())
    return (
        f'<object id="{MATERIALS_ID + 1 + number}" type="model" name={quoteattr(part.name)} '
        f'pid="{MATERIALS_ID}" pindex="{number}"><mesh><vertices>{vertices}</vertices>'
        f"<triangles>{faces}</triangles></mesh></object>"
    )


def _hex(colour: Sequence[float]) -> str:
    return "#" + "".join(f"{round(255.0 * each):02X}" for each in colour)
