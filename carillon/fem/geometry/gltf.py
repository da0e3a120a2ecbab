"""glTF files in the plain form that trimesh reads rightly: triangles of floating-point positions.

Nothing else of them is handed on: neither pictures, nor what no triangle uses, nor files beside it.
Legal, but not read as what they say: positions in integers, normalised or not
(KHR_mesh_quantization), sparse accessors, fans of triangles, lines beside triangles, meshes at a
camera's node. What takes an extension that is not known here is refused (Khronos: glTF 2.0, 3.12).
"""

from __future__ import annotations

import base64
import json
import struct
from collections import Counter
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
TRIANGLES, STRIP, _FAN = 4, 5, 6

_CORNERS = {TRIANGLES: 1, STRIP: 3, _FAN: 3}
"""Modes that are read, and corners of triangles for an index."""
_POSITION_BYTES, _CORNER_BYTES = 12, 4

DEEPEST = 128
"""Nodes inside each other."""
MOST_PRIMITIVES = 10_000
"""Groups of triangles of all meshes: each takes about a millisecond."""
SHARED_BYTES, GROWTH = 1 << 27, 4
"""Bytes of triangles that any file may stand for, and how often its own length a longer one may.

Nodes share meshes, and meshes share positions, so a few bytes can stand for any number.
"""
_KEPT = ("mesh", "children", "name", "matrix", "translation", "rotation", "scale")
"""Keys of a node that are handed on."""

ReadBeside = Callable[[str, int | None], bytes]


def plain_gltf(content: bytes, beside: ReadBeside, name: str) -> bytes:
    """A GLB with the triangles of a glTF file, text or binary.

    `beside`: reads as many bytes of a file in the mesh's folder.

    Raises
    ------
    UserError
        If the triangles are in an extension that is not read, or far more than the file is long;
        nothing is allocated for them then.
    Exception
        Of any kind, for a file that is no glTF.
    """
    header, reader = opened_gltf(content, beside, name)
    data, meshes = _Data(), []
    for mesh in header.get("meshes", []):
        primitives = [reader.arrays(each) for each in mesh["primitives"]]
        meshes.append({"primitives": [data.primitive(*each) for each in primitives if each]})
    nodes = [{key: node[key] for key in _KEPT if key in node} for node in header.get("nodes", [])]
    kept: Header = {key: header[key] for key in ("asset", "scene", "scenes") if key in header}
    return data.glb({**kept, "nodes": nodes, "meshes": meshes})


def opened_gltf(content: bytes, beside: ReadBeside, name: str) -> tuple[Header, GltfReader]:
    """The header of a glTF file, which is checked, and what reads its triangles.

    Raises what `plain_gltf` raises.
    """
    header, binary = _parts(content)
    _require_known(header.get("extensionsRequired", []), name)
    _require_at_rest(header, name)
    _require_tree(header.get("nodes", []))
    reader = GltfReader(header, binary, beside, name)
    reader.require_proportion(len(content))
    return header, reader


def _parts(content: bytes) -> tuple[Header, bytes]:
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


def _require_tree(nodes: list[Header]) -> None:
    """Check that no node is in two others, or too deep: each one's place is a product of those."""
    above = dict[int, int]()
    for number, node in enumerate(nodes):
        for child in node.get("children", []):
            if above.setdefault(child, number) != number:
                raise ValueError(f"node {child} is in two others")
    depths = dict[int, int]()
    for number in range(len(nodes)):
        way: list[int] = []
        while number in above and number not in depths and len(way) <= DEEPEST:
            way.append(number)
            number = above[number]
        depth = depths.get(number, 0) + len(way)
        if depth > DEEPEST:
            raise ValueError(f"its nodes are more than {DEEPEST} deep, or in themselves")
        depths.update({each: depth - at for at, each in enumerate(way)})


class _Data:
    def __init__(self) -> None:
        self._views: list[Header] = []
        self._accessors: list[Header] = []
        self._bytes = bytearray()

    def add(self, values: NDArray[Any], component: int, kind: str) -> int:
        content = np.ascontiguousarray(values, dtype=_DTYPES[component]).tobytes()
        accessor = {"bufferView": len(self._views), "componentType": component}
        self._accessors.append({**accessor, "count": len(values), "type": kind})
        view = {"buffer": 0, "byteOffset": len(self._bytes), "byteLength": len(content)}
        self._views.append(view)
        self._bytes += content
        return len(self._accessors) - 1

    def primitive(self, positions: NDArray[Any], corners: NDArray[Any], mode: int) -> Header:
        return {
            "attributes": {"POSITION": self.add(positions, _FLOAT, "VEC3")},
            "indices": self.add(corners, _UINT32, "SCALAR"),
            "mode": mode,
        }

    def glb(self, header: Header) -> bytes:
        buffers = [{"byteLength": len(self._bytes)}]
        tables = {"accessors": self._accessors, "bufferViews": self._views, "buffers": buffers}
        text = json.dumps({**header, **tables}).encode()
        text = text.ljust(-(-len(text) // 4) * 4)
        length = 12 + 8 + len(text) + 8 + len(self._bytes)
        start = struct.pack("<4sIII4s", _MAGIC, _VERSION, length, len(text), _JSON)
        return start + text + struct.pack("<I4s", len(self._bytes), _BINARY) + self._bytes


class GltfReader:
    """Triangles of primitives."""

    def __init__(self, header: Header, binary: bytes, beside: ReadBeside, name: str) -> None:
        self._header, self._binary, self._beside, self._name = header, binary, beside, name
        self._read: dict[str, bytes] = {}

    def require_proportion(self, length: int) -> None:
        """Refuse triangles that take far more bytes than a file of this length and those beside."""
        accessors = self._header.get("accessors", [])
        uses = Counter(node.get("mesh") for node in self._header.get("nodes", []))
        taken = 0
        many = sum(len(mesh["primitives"]) for mesh in self._header.get("meshes", []))
        if many > MOST_PRIMITIVES:
            raise UserError(
                f"{self._name}: its meshes have {many:,} primitives, expected at most "
                f"{MOST_PRIMITIVES:,}; join them"
            )
        for number, mesh in enumerate(self._header.get("meshes", [])):
            for primitive in mesh["primitives"]:
                if primitive.get("mode", TRIANGLES) in _CORNERS:
                    taken += max(uses[number], 1) * self._bytes_of(primitive, accessors)
        there = length + sum(map(len, self._read.values()))
        if taken > SHARED_BYTES + GROWTH * there:
            raise UserError(
                f"{self._name}: its triangles take {taken:,} bytes, far more than the {there:,} of "
                "the file; leave out parts, or export one part alone"
            )

    def _bytes_of(self, primitive: Header, accessors: list[Header]) -> int:
        """Bytes of positions and triangles, whose buffers are read."""
        used = [accessors[primitive["attributes"]["POSITION"]]]
        used += [accessors[primitive["indices"]]] if "indices" in primitive else []
        for each, kind in zip(used, ("VEC3", "SCALAR")):
            if each["type"] != kind or int(each["count"]) < 1:
                raise ValueError(f"found {each['count']} {each['type']}, expected some {kind}")
            if "bufferView" in each:
                self._buffer(self._header["bufferViews"][each["bufferView"]])
        corners = _CORNERS[primitive.get("mode", TRIANGLES)] * int(used[-1]["count"])
        return _POSITION_BYTES * int(used[0]["count"]) + _CORNER_BYTES * corners

    def arrays(self, primitive: Header) -> tuple[NDArray[Any], NDArray[Any], int] | None:
        """Positions (p, 3), corners (k,) and mode: `TRIANGLES` or `STRIP`; None of lines."""
        mode = primitive.get("mode", TRIANGLES)
        if mode not in _CORNERS:
            return None
        extensions = list(primitive.get("extensions", {}))
        positions = self._values(primitive["attributes"]["POSITION"], extensions)
        corners = np.arange(len(positions))
        if "indices" in primitive:
            corners = self._values(primitive["indices"], extensions).ravel().astype(np.int64)
        if mode == _FAN:
            fan = np.stack([np.full(len(corners) - 2, corners[0]), corners[1:-1], corners[2:]], 1)
            mode, corners = TRIANGLES, fan.ravel()
        return positions, corners, mode

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
        start, row = view.get("byteOffset", 0), columns * dtype.itemsize
        content = memoryview(self._buffer(view))[start : start + view["byteLength"]]
        stride = view.get("byteStride") or row
        begin = place.get("byteOffset", 0)
        end = begin + (count - 1) * stride + row
        if start < 0 or begin < 0 or count < 1 or end > len(content):
            raise ValueError(f"an accessor reaches to byte {end} of {len(content)}")
        if stride < row:
            raise ValueError(f"its rows of {row} bytes begin every {stride} bytes")
        rows: NDArray[Any] = np.ndarray(
            (count, columns), dtype, content, begin, (stride, dtype.itemsize)
        )
        return rows.copy()

    def _buffer(self, view: Header) -> bytes:
        number = view["buffer"]
        buffer = self._header["buffers"][number]
        uri = buffer.get("uri")
        if uri is None and (number > 0 or not self._binary):
            extensions = ", ".join(view.get("extensions", {})) or "another file"
            raise UserError(
                f"{self._name}: has data in {extensions} alone, which is not read; export it "
                "again, uncompressed"
            )
        if uri is None:
            return self._binary
        if uri not in self._read:
            if uri.startswith("data:"):
                self._read[uri] = base64.b64decode(uri.partition("base64,")[2])
            else:
                self._read[uri] = self._beside(unquote(uri), buffer.get("byteLength"))
        return self._read[uri]
