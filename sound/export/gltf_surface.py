"""glTF: the surface of a design with normals, and Young's modulus as colours of its vertices."""

from typing import Any

import numpy as np

from carillon.arrays import Array
from sound.export.gltf_asset import FLOAT, TRIANGLES, UNSIGNED_INT, VERTICES, Buffer
from sound.project.design import Design
from sound.scenes.performance import linear_light

CREASE_DEGREES = 35.0
"""Angle between triangles from which on the edge between them looks sharp."""
LEAST_DECADES = 1.0
"""Least range of moduli, in decades, that the colours stand for, about the middle."""
ROUGHNESS = 0.5
"""Roughness of the surface in glTF's sense, from 0, a mirror, to 1."""
_COLOURS = "440154 472d7b 3b528b 2c728e 21918c 28ae80 5ec962 addc30 fde725"
"""Viridis (matplotlib, CC0) in nine steps, sRGB."""


def surface_mesh(design: Design, buffer: Buffer) -> dict[str, Any]:
    """The mesh of a document, whose one material is the first; its data goes into the buffer.

    Vertices on sharp edges are there once for each side.  Triangles face outwards.
    """
    vertices, faces, normals = shaded(design.surface_vertices, design.surface_faces)
    colours = colours_of(design.young_near(vertices))
    attributes = {
        "POSITION": buffer.add(vertices, FLOAT, VERTICES),
        "NORMAL": buffer.add(normals, FLOAT, VERTICES),
        "COLOR_0": buffer.add(colours, FLOAT, VERTICES),
    }
    indices = buffer.add(faces.ravel(), UNSIGNED_INT, TRIANGLES)
    primitive = {"attributes": attributes, "indices": indices, "material": 0}
    return {"name": "surface", "primitives": [primitive]}


def surface_material(design: Design) -> dict[str, Any]:
    """The material of the mesh: white, which the colours of vertices are multiplied with."""
    low, high = _range(np.log10(design.young))
    return {
        "name": "designed",
        "doubleSided": True,
        "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": ROUGHNESS},
        "extras": {
            "COLOR_0": "Young's modulus, viridis over its logarithm",
            "youngsModulusRange": [10.0**low, 10.0**high],
            "units": "Pa",
        },
    }


def shaded(vertices: Array, faces: Any) -> tuple[Array, Any, Array]:
    """Vertices (v, 3), triangles (f, 3) and unit normals (v, 3) of a surface that is to be seen.

    Triangles (F, 3) of `faces` on `vertices` (V, 3) are turned alike; those returned face outwards.
    """
    import trimesh

    surface = trimesh.Trimesh(vertices, faces, process=False)
    surface.merge_vertices()
    surface.update_faces(surface.nondegenerate_faces())
    surface.remove_unreferenced_vertices()
    if surface.volume < 0.0:  # its faces are turned alike, those of cavities too
        surface.invert()
    smooth = trimesh.graph.smooth_shade(surface, angle=np.radians(CREASE_DEGREES))
    normals = np.array(smooth.vertex_normals)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    # A sheet without thickness has none where its sides meet.
    normals = np.where(length > 0.5, normals / np.maximum(length, 0.5), (0.0, 0.0, 1.0))
    return np.array(smooth.vertices), np.array(smooth.faces), normals


def colours_of(young: Array) -> Array:
    """Linear red, green and blue with alpha 1 (p, 4) of Young's moduli (p,) [Pa]."""
    decades = np.log10(young)
    low, high = _range(decades)
    parts = [[int(each[at : at + 2], 16) / 255.0 for at in (0, 2, 4)] for each in _COLOURS.split()]
    stops = np.array([linear_light(part) for part in parts])
    share = (decades - low) / (high - low) * (len(stops) - 1)
    channels = [np.interp(share, np.arange(len(stops)), channel) for channel in stops.T]
    return np.column_stack([*channels, np.ones(len(young))])


def _range(decades: Array) -> tuple[float, float]:
    low, high = float(decades.min()), float(decades.max())
    more = max(0.0, LEAST_DECADES - (high - low)) / 2.0
    return low - more, high + more
