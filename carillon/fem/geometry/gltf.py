"""glTF files in the plain form that trimesh reads rightly: triangles of floating-point positions.

Legal, but not read as what they say: positions in integers, normalised or not
(KHR_mesh_quantization), sparse accessors, fans of triangles, lines beside triangles, meshes at a
camera's node. What takes an extension that is not known here is refused (Khronos: glTF 2.0, 3.12).
"""

from __future__ import annotations

import base64
import json
import struct
from collections.abc import Callable
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from carillon.errors import UserError

Header = dict[str, Any]

HARMLESS = (
    "KHR_mesh_quantization",
    "KHR_materials_",
    "KHR_texture_",
    "EXT_texture_",
    "MSFT_texture_",
    "KHR_lights_",
    "EXT_lights_",
    "KHR_xmp",
    "KHR_animation_",
    "KHR_audio",
    "KHR_interactivity",
    "EXT_mesh_features",
    "EXT_mesh_manifold",
    "EXT_structural_metadata",
    "EXT_instance_features",
)
"""Beginnings of the names of extensions that leave the triangles alone, or are read here."""

_MAGIC, _VERSION, _JSON, _BINARY = b"glTF", 2, b"JSON", b"BIN\0"
_FLOAT, _UINT32 = 5126, 5125
_DTYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", _UINT32: "<u4", _FLOAT: "<f4"}
_COLUMNS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_TRIANGLES, _STRIP, _FAN = 4, 5, 6


def plain_gltf(content: bytes, beside: Callable[[str], bytes], name: str) -> bytes | None:
    """A GLB with the triangles of a glTF file, text or binary; None if the file is plain itself.

    Parameters
    ----------
    beside
        Reads a file in the mesh's folder.
    name
        Of the mesh, for messages.

    Raises
    ------
    UserError
        If the triangles are in an extension that is not read.
    Exception
        Of any kind, for a file that is no glTF.
    """
    header, binary = _parts(content)
    _require_known(header.get("extensionsRequired", []), name)
    _require_at_rest(header, name)
    if _is_plain(header):
        return None
    reader = _Reader(header, binary, beside, name)
    data, meshes = _Data(), []
    for mesh in header.get("meshes", []):
        primitives = [reader.triangles(each, data) for each in mesh["primitives"]]
        meshes.append({"primitives": [each for each in primitives if each is not None]})
    nodes = [
        {key: value for key, value in node.items() if key not in ("camera", "extensions")}
        for node in header.get("nodes", [])
    ]
    kept: Header = {key: header[key] for key in ("asset", "scene", "scenes") if key in header}
    return data.glb({**kept, "nodes": nodes, "meshes": meshes})


def _parts(content: bytes) -> tuple[Header, bytes]:
    """Header and binary chunk."""
    if not content.startswith(_MAGIC):
        return json.loads(content), b""
    place, header, binary = 12, {}, b""
    while place + 8 <= len(content):
        length, kind = struct.unpack_from("<I4s", content, place)
        chunk = content[place + 8 : place + 8 + length]
        if kind == _JSON:
            header = json.loads(chunk)
        elif kind == _BINARY and not binary:
            binary = chunk
        place += 8 + length
    return header, binary


def _require_known(extensions: list[str], name: str) -> None:
    unknown = [each for each in extensions if not each.startswith(HARMLESS)]
    if unknown:
        raise UserError(
            f"{name}: needs {', '.join(unknown)}, which is not read; export it without "
            "(uncompressed)"
        )


def _require_at_rest(header: Header, name: str) -> None:
    """Refuse meshes that something else than their nodes deforms."""
    nodes, meshes = header.get("nodes", []), header.get("meshes", [])
    if any("skin" in node and "mesh" in node for node in nodes):
        raise UserError(f"{name}: is bent by a skeleton, which is not read; export it without skin")
    for node in nodes:
        mesh = meshes[node["mesh"]] if "mesh" in node else {}
        if any(node.get("weights", mesh.get("weights", []))):
            raise UserError(
                f"{name}: is mixed from morph targets, which are not read; export it as it is seen"
            )


def _is_plain(header: Header) -> bool:
    accessors = header.get("accessors", [])
    for mesh in header.get("meshes", []):
        for primitive in mesh["primitives"]:
            if primitive.get("mode", _TRIANGLES) not in (_TRIANGLES, _STRIP):
                return False
            positions = accessors[primitive["attributes"]["POSITION"]]
            used = [positions]
            used += [accessors[primitive["indices"]]] if "indices" in primitive else []
            if positions["componentType"] != _FLOAT:
                return False
            if any("sparse" in each or "bufferView" not in each for each in used):
                return False
    if any("camera" in node and "mesh" in node for node in header.get("nodes", [])):
        return False
    views = header.get("bufferViews", [])
    uris = [each.get("uri", "") for each in header.get("buffers", [])]
    named = any("%" in uri and not uri.startswith("data:") for uri in uris)
    return not named and not any("extensions" in view for view in views)


class _Data:
    """The one buffer of a GLB."""

    def __init__(self) -> None:
        self._views: list[Header] = []
        self._accessors: list[Header] = []
        self._bytes = bytearray()

    def add(self, values: NDArray[Any], component: int, kind: str) -> int:
        """Number of an accessor for values of four bytes."""
        content = np.ascontiguousarray(values, dtype=_DTYPES[component]).tobytes()
        self._views.append(
            {"buffer": 0, "byteOffset": len(self._bytes), "byteLength": len(content)}
        )
        self._accessors.append(
            {
                "bufferView": len(self._views) - 1,
                "componentType": component,
                "count": len(values),
                "type": kind,
            }
        )
        self._bytes += content
        return len(self._accessors) - 1

    def glb(self, header: Header) -> bytes:
        """The file with this header."""
        buffers = [{"byteLength": len(self._bytes)}]
        tables = {"accessors": self._accessors, "bufferViews": self._views, "buffers": buffers}
        text = json.dumps({**header, **tables}).encode()
        text = text.ljust(-(-len(text) // 4) * 4)
        length = 12 + 8 + len(text) + 8 + len(self._bytes)
        return b"".join(
            [
                struct.pack("<4sII", _MAGIC, _VERSION, length),
                struct.pack("<I4s", len(text), _JSON),
                text,
                struct.pack("<I4s", len(self._bytes), _BINARY),
                bytes(self._bytes),
            ]
        )


class _Reader:
    """Values of the accessors of a glTF file."""

    def __init__(
        self, header: Header, binary: bytes, beside: Callable[[str], bytes], name: str
    ) -> None:
        self._header, self._binary, self._beside, self._name = header, binary, beside, name
        self._read: dict[int, bytes] = {}

    def triangles(self, primitive: Header, data: _Data) -> Header | None:
        """The primitive as triangles, whose values go into `data`; None of points and lines."""
        mode = primitive.get("mode", _TRIANGLES)
        if mode not in (_TRIANGLES, _STRIP, _FAN):
            return None
        extensions = list(primitive.get("extensions", {}))
        positions = self._values(primitive["attributes"]["POSITION"], extensions)
        corners = np.arange(len(positions))
        if "indices" in primitive:
            corners = self._values(primitive["indices"], extensions).ravel().astype(np.int64)
        if mode == _FAN:
            fan = np.stack([np.full(len(corners) - 2, corners[0]), corners[1:-1], corners[2:]], 1)
            mode, corners = _TRIANGLES, fan.ravel()
        return {
            "attributes": {"POSITION": data.add(positions, _FLOAT, "VEC3")},
            "indices": data.add(corners, _UINT32, "SCALAR"),
            "mode": mode,
        }

    def _values(self, index: int, extensions: list[str]) -> NDArray[Any]:
        """Rows (n, columns) of an accessor."""
        accessor = self._header["accessors"][index]
        count, columns = int(accessor["count"]), _COLUMNS[accessor["type"]]
        component, sparse = accessor["componentType"], accessor.get("sparse")
        if "bufferView" in accessor:
            values = self._rows(accessor, component, count, columns)
        elif sparse:
            values = np.zeros((count, columns), dtype=_DTYPES[component])
        else:
            where = f" but in {', '.join(extensions)}, which is not read" if extensions else ""
            raise UserError(
                f"{self._name}: has no coordinates in accessor {index}{where}; export it again, "
                "uncompressed"
            )
        if sparse:
            changed = int(sparse["count"])
            rows = self._rows(sparse["indices"], sparse["indices"]["componentType"], changed, 1)
            values[rows.ravel()] = self._rows(sparse["values"], component, changed, columns)
        if accessor.get("normalized") and component != _FLOAT:
            return np.maximum(values / float(np.iinfo(values.dtype).max), -1.0)
        return values

    def _rows(self, place: Header, component: int, count: int, columns: int) -> NDArray[Any]:
        dtype = np.dtype(_DTYPES[component])
        view = self._header["bufferViews"][place["bufferView"]]
        start = view.get("byteOffset", 0)
        content = self._buffer(view)[start : start + view["byteLength"]]
        stride = view.get("byteStride") or columns * dtype.itemsize
        begin = place.get("byteOffset", 0)
        end = begin + (count - 1) * stride + columns * dtype.itemsize
        if begin < 0 or count < 1 or end > len(content):
            raise ValueError(f"an accessor reaches to byte {end} of {len(content)}")
        rows: NDArray[Any] = np.ndarray(
            (count, columns), dtype, content, begin, (stride, dtype.itemsize)
        )
        return rows.copy()

    def _buffer(self, view: Header) -> bytes:
        number = view["buffer"]
        if number not in self._read:
            uri = self._header["buffers"][number].get("uri")
            if uri is None and (number > 0 or not self._binary):
                extensions = ", ".join(view.get("extensions", {})) or "another file"
                raise UserError(
                    f"{self._name}: has data in {extensions} alone, which is not read; export it "
                    "again, uncompressed"
                )
            if uri is None:
                self._read[number] = self._binary
            elif uri.startswith("data:"):
                self._read[number] = base64.b64decode(uri.partition("base64,")[2])
            else:
                self._read[number] = self._beside(unquote(uri))
        return self._read[number]
