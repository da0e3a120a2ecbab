"""Mesh files made by code: boxes in OBJ and glTF as the formats allow them (test support)."""

import base64
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

DTYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
"""Of the component types of glTF."""


def block(low: tuple[float, float, float], high: tuple[float, float, float]) -> trimesh.Trimesh:
    """Box between two corners."""
    return trimesh.creation.box(bounds=[low, high])


def concatenated(*parts: trimesh.Trimesh) -> trimesh.Trimesh:
    """The parts as one surface, not united."""
    return trimesh.util.concatenate(parts)


def inside_out(surface: trimesh.Trimesh) -> trimesh.Trimesh:
    """The surface with all faces turned."""
    return trimesh.Trimesh(surface.vertices, surface.faces[:, ::-1], process=False)


def with_turned(surface: trimesh.Trimesh, *numbers: int) -> trimesh.Trimesh:
    """The surface with some faces turned."""
    faces = np.array(surface.faces)
    faces[list(numbers)] = faces[list(numbers), ::-1]
    return trimesh.Trimesh(surface.vertices, faces, process=False)


def both_ways(surface: trimesh.Trimesh, *numbers: int) -> trimesh.Trimesh:
    """The surface with some faces, or all, there the other way too."""
    faces = np.array(surface.faces)
    more = faces[list(numbers)] if numbers else faces
    return trimesh.Trimesh(surface.vertices, np.concatenate([faces, more[:, ::-1]]), process=False)


def soup(surface: trimesh.Trimesh) -> trimesh.Trimesh:
    """The surface with vertices of its own for each face, as in STL."""
    corners = np.asarray(surface.triangles).reshape(-1, 3)
    return trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), process=False)


def merged(surface: trimesh.Trimesh) -> trimesh.Trimesh:
    """The surface with one vertex at each place."""
    surface = surface.copy()
    surface.merge_vertices()
    return surface


def saved(surface: trimesh.Trimesh, path: Path) -> str:
    """The path of a PLY file of the surface, with its faces in order."""
    surface.export(path)
    return str(path)


class Gltf:
    """A glTF file in the making: one mesh of one primitive at one node."""

    def __init__(self) -> None:
        self.header: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {}}]}],
            "accessors": [],
            "bufferViews": [],
            "buffers": [{"byteLength": 0}],
        }
        self.data = bytearray()

    @property
    def primitive(self) -> dict[str, Any]:
        """The first primitive of the mesh."""
        return self.header["meshes"][0]["primitives"][0]

    def view(self, values: NDArray[Any], stride: int | None = None) -> int:
        """Number of a view of rows (n, k), each padded to `stride` bytes."""
        rows = np.ascontiguousarray(values).reshape(len(values), -1)
        content = rows.view(np.uint8).reshape(len(rows), -1)
        if stride:
            content = np.pad(content, [(0, 0), (0, stride - content.shape[1])])
        self.data += bytes(-len(self.data) % 4)
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": content.size}
        self.header["bufferViews"].append(view | ({"byteStride": stride} if stride else {}))
        self.data += content.tobytes()
        return len(self.header["bufferViews"]) - 1

    def accessor(
        self, values: NDArray[Any], component: int, stride: int | None = None, **more: Any
    ) -> int:
        """Number of an accessor of values (n,) or (n, 3)."""
        kind = "VEC3" if values.ndim == 2 else "SCALAR"
        view = self.view(values.astype(DTYPES[component]), stride)
        entry = {"bufferView": view, "componentType": component, "count": len(values), "type": kind}
        self.header["accessors"].append(entry | more)
        return len(self.header["accessors"]) - 1

    def written(self, path: Path) -> str:
        """The path of the file, whose ending says whether it is text or binary."""
        header = json.loads(json.dumps(self.header))
        header["buffers"][0]["byteLength"] = len(self.data)
        if path.suffix == ".gltf":
            text = base64.b64encode(bytes(self.data)).decode()
            header["buffers"][0]["uri"] = f"data:application/octet-stream;base64,{text}"
            path.write_text(json.dumps(header))
            return str(path)
        chunk = json.dumps(header).encode()
        chunk = chunk.ljust(-(-len(chunk) // 4) * 4)
        data = bytes(self.data).ljust(-(-len(self.data) // 4) * 4, b"\0")
        length = 28 + len(chunk) + len(data)
        start = struct.pack("<4sIII4s", b"glTF", 2, length, len(chunk), b"JSON")
        path.write_bytes(start + chunk + struct.pack("<I4s", len(data), b"BIN\0") + data)
        return str(path)


def gltf(surface: trimesh.Trimesh) -> Gltf:
    """A surface as glTF."""
    file = Gltf()
    vertices, faces = np.asarray(surface.vertices), np.asarray(surface.faces)
    file.primitive["attributes"]["POSITION"] = file.accessor(vertices, 5126)
    file.primitive["indices"] = file.accessor(faces.ravel(), 5125)
    return file
