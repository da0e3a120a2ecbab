"""glTF 2.0 files: buffers with their accessors, and both forms of a file."""

import base64
import json
import struct
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from carillon.arrays import Array
from carillon.fem.geometry.turning import upright_rotation
from carillon.files.atomic import atomic_path

FLOAT, UNSIGNED_INT = 5126, 5125
VERTICES, TRIANGLES = 34962, 34963
_ALIGNMENT = 4
_WIDTHS = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}
_MAGIC, _JSON, _BIN = 0x46546C67, 0x4E4F534A, 0x004E4942


class Buffer:
    """Data of accessors, one view each, aligned to four bytes as all of them are."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(self, values: NDArray[Any], component: int, target: int | None = None) -> int:
        """Append values (n,), (n, 3) or (n, 4); returns the number of their accessor."""
        rows = values.reshape(len(values), -1).astype("<f4" if component == FLOAT else "<u4")
        self.accessors.append(
            {
                "bufferView": self.add_bytes(rows.tobytes(), target),
                "componentType": component,
                "count": len(rows),
                "type": _WIDTHS[rows.shape[1]],
                "min": rows.min(axis=0).tolist(),
                "max": rows.max(axis=0).tolist(),
            }
        )
        return len(self.accessors) - 1

    def add_bytes(self, raw: bytes, target: int | None = None) -> int:
        """Append bytes, such as a file; returns the number of their view."""
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(raw)}
        self.views.append(view if target is None else {**view, "target": target})
        self.data += raw + b"\0" * (-len(raw) % _ALIGNMENT)
        return len(self.views) - 1

    def entries(self) -> dict[str, Any]:
        """Entries of a document that describe the buffer."""
        return {
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{"byteLength": len(self.data)}],
        }


def node_rotation(turn: Array | None = None) -> list[float]:
    """Quaternion (x, y, z, w) of a node that turns axes whose z points up to glTF's, whose y does.

    `turn` (3, 3) goes before it: the rotation of the node's coordinates to such axes, if any.

    Examples
    --------
    >>> [round(each, 4) for each in node_rotation()]
    [-0.7071, 0.0, 0.0, 0.7071]
    >>> node_rotation(upright_rotation("y"))
    [0.0, 0.0, 0.0, 1.0]
    """
    from scipy.spatial.transform import Rotation

    z_to_y = upright_rotation("y").T
    whole = z_to_y if turn is None else z_to_y @ turn
    return (Rotation.from_matrix(whole).as_quat(canonical=True) + 0.0).tolist()


def write_asset(path: str | Path, document: dict[str, Any], data: bytes, binary: bool) -> None:
    """Write `.glb` if `binary`, else `.gltf` with the data, the document's only buffer, embedded in
    it.

    Raises UserError if the file cannot be written.
    """
    with atomic_path(path) as temporary:
        if binary:
            temporary.write_bytes(_glb(document, data))
        else:
            text = base64.b64encode(data).decode()
            document["buffers"][0]["uri"] = f"data:application/octet-stream;base64,{text}"
            temporary.write_text(json.dumps(document))


def _glb(document: dict[str, Any], data: bytes) -> bytes:
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % _ALIGNMENT)
    data += b"\0" * (-len(data) % _ALIGNMENT)
    length = 12 + 8 + len(text) + 8 + len(data)
    return b"".join(
        [
            struct.pack("<III", _MAGIC, 2, length),
            struct.pack("<II", len(text), _JSON),
            text,
            struct.pack("<II", len(data), _BIN),
            data,
        ]
    )
