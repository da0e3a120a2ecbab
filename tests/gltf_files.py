"""Files in glTF as other programs read them (test support)."""

import base64
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

from sound.export.gltf import UNSIGNED_INT

WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}


def read_gltf(path: Path) -> tuple[dict[str, Any], bytes]:
    """JSON and buffer of either kind of file, by the specification."""
    raw = path.read_bytes()
    if path.suffix == ".gltf":
        document = json.loads(raw)
        return document, base64.b64decode(document["buffers"][0]["uri"].split(",", 1)[1])
    magic, version, total, length, kind = struct.unpack("<4sIII4s", raw[:20])
    assert (magic, version, total, kind) == (b"glTF", 2, len(raw), b"JSON")
    data_length, kind = struct.unpack("<I4s", raw[20 + length : 28 + length])
    assert kind == b"BIN\0" and 28 + length + data_length == total
    return json.loads(raw[20 : 20 + length]), raw[28 + length :]


def accessor(document: dict[str, Any], data: bytes, number: int) -> np.ndarray:
    entry = document["accessors"][number]
    view = document["bufferViews"][entry["bufferView"]]
    kind = "<u4" if entry["componentType"] == UNSIGNED_INT else "<f4"
    count = entry["count"] * WIDTHS[entry["type"]]
    assert view["byteOffset"] % 4 == 0 and view["byteLength"] == 4 * count
    return np.frombuffer(data, kind, count, view["byteOffset"]).reshape(entry["count"], -1)
