"""The parts of a design that was built: a closed surface for each of its materials."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np
import scipy.ndimage as ndi

from carillon.arrays import Array, Index, Integers
from carillon.errors import UserError
from sound.export.names import file_names
from sound.export.voxel_surface import voxel_surface
from sound.project.build import too_thin
from sound.project.design import Design

MILLIMETRES = 1e3
"""Of a metre."""
SOLID = "solid"
"""Name of the file of all parts together, without its ending, which no part may have."""
REACH = 2
"""Voxels by which parts are made to go on beyond the voxels, before the surface cuts them."""
LEAST_VOLUME = 1e-9
"""Volume of a piece, over that of its part, below which it is a trace of rounding."""


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


def built_parts(design: Design) -> BuiltParts:
    """Parts of a design that was built, cut by its surface if manifold3d is there to do it.

    Raises UserError if the design was not built, or its parts are thinner than can be printed.
    """
    told = materials_of(design)
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
    names = file_names([SOLID, *(str(told[number]["name"]) for number in numbers)])[1:]
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


def materials_of(design: Design) -> list[Mapping[str, Any]]:
    """Entries of the materials of a design that was built, in the order of its table.

    Raises UserError if it was not built, or its parts are thinner than can be printed.
    """
    build = design.evidence.get("build")
    if not build or design.fine_region is None:
        raise UserError(
            "the design is a continuous field, which has no parts; name real materials below build "
            "in its project, and design again"
        )
    if fault := too_thin(build.get("at_least_m")):
        raise UserError(fault)
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
