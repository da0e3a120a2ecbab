"""Named parts of a solid: surfaces of scenes (glTF, OBJ, 3MF) and of several files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from carillon.errors import UserError
from carillon.fem.geometry.scene_parts import Part
from carillon.fem.geometry.surface import (
    FLATNESS,
    checked_surface,
    load_surface,
    parts_of_scene,
    surface_name,
)
from carillon.fem.geometry.turning import turned_upright

if TYPE_CHECKING:
    import trimesh

MOST_PARTS = 10_000
"""Parts of all files together."""


def named_surfaces(
    meshes: str | Path | Sequence[str | Path], unit: float = 1.0, up: str | None = None
) -> list[tuple[str, trimesh.Trimesh]]:
    """The parts of files and their surfaces [m], each checked as by `load_surface`, facing out.

    Names may be equal, as of parts of one material. A part of glTF is a node that has a mesh, one
    of OBJ an object, one of 3MF an object with triangles. Where materials of a node, or groups or
    materials of an object, are closed surfaces each, they are parts. Other files are one part each,
    which has the name of the file, and so have parts without a name. Flat parts, which enclose
    nothing, are left out. `up` is turned to z, see `carillon.fem.geometry.turning`.

    Raises UserError for what `load_surface` refuses, of each part; if there are more than
    `MOST_PARTS`, or none.

    Examples
    --------
    >>> [(name, bool(surface.is_watertight)) for name, surface in named_surfaces("builtin:bar")]
    [('bar', True)]
    """
    paths = [meshes] if isinstance(meshes, str | Path) else list(meshes)
    found: list[tuple[str, trimesh.Trimesh]] = []
    for path in map(str, paths):
        parts = parts_of_scene(path)
        if parts is None:
            found.append((surface_name(path), _outwards(load_surface(path, unit))))
        else:
            if len(parts) > MOST_PARTS:
                raise UserError(
                    f"{path}: has {len(parts):,} parts, expected at most {MOST_PARTS:,}; join them"
                )
            found += _checked(path, parts, unit)
    if len(found) > MOST_PARTS:
        raise UserError(f"found {len(found):,} parts, expected at most {MOST_PARTS:,}; join them")
    return [(name, turned_upright(surface, up)) for name, surface in found]


def _checked(path: str, parts: list[Part], unit: float) -> list[tuple[str, trimesh.Trimesh]]:
    solid = [part for part in parts if not _is_flat(part)]
    if not solid:
        raise UserError(
            f"{path}: has no part that encloses anything, expected surfaces around solids; export "
            "it as a mesh"
        )
    named = []
    for part in solid:
        name = part.name or surface_name(path)
        whole = f"{path}, part {name!r:.60}" if len(solid) > 1 else path
        named.append((name, _outwards(checked_surface(part.vertices, part.faces, whole, unit))))
    return named


def _outwards(surface: trimesh.Trimesh) -> trimesh.Trimesh:
    """The surface, turned if its faces look inwards."""
    if surface.volume < 0.0:
        surface.invert()
    return surface


def _is_flat(part: Part) -> bool:
    sides = np.ptp(part.vertices, axis=0)
    return bool(sides.min() <= FLATNESS * sides.max())
