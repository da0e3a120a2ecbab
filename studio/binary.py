"""Arrays with a header, as the page reads them without copying: surfaces and banks of modes."""

import json
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

TYPES: dict[str, np.dtype[Any]] = {
    "f4": np.dtype("<f4"),
    "f8": np.dtype("<f8"),
    "u4": np.dtype("<u4"),
    "u2": np.dtype("<u2"),
}
"""Types of arrays by their names in headers."""
_ALIGNED = 8
"""Alignment of arrays in a message in bytes; views of 8-byte numbers need it."""
_LENGTH = struct.Struct("<I")


def pack(header: Mapping[str, Any], arrays: Mapping[str, tuple[str, Any]]) -> bytes:
    """A binary message of a header, fit for JSON, and arrays by name: type (see `TYPES`) and
    values.

    Examples
    --------
    >>> message = pack({"event": "bank"}, {"hertz": ("f8", [440.0, 880.0])})
    >>> header, arrays = unpack(message)
    >>> header["event"], arrays["hertz"].tolist(), len(message) % 8
    ('bank', [440.0, 880.0], 0)
    """
    blocks = {
        name: np.ascontiguousarray(values, TYPES[kind]) for name, (kind, values) in arrays.items()
    }
    listed = [
        {"name": name, "type": arrays[name][0], "shape": list(block.shape)}
        for name, block in blocks.items()
    ]
    text = json.dumps({**header, "arrays": listed}, allow_nan=False).encode()
    text += b" " * (-(len(text) + _LENGTH.size) % _ALIGNED)
    parts = [_LENGTH.pack(len(text)), text]
    for block in blocks.values():
        parts += [block.tobytes(), b"\0" * (-block.nbytes % _ALIGNED)]
    return b"".join(parts)


def unpack(message: bytes) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Header and arrays of a message that `pack` made."""
    (length,) = _LENGTH.unpack_from(message)
    begin = _LENGTH.size + length
    header = json.loads(message[_LENGTH.size : begin])
    arrays = {}
    for entry in header["arrays"]:
        kind, shape = TYPES[entry["type"]], tuple(entry["shape"])
        size = int(np.prod(shape))
        arrays[entry["name"]] = np.frombuffer(message, kind, size, begin).reshape(shape)
        begin += -(-size * kind.itemsize // _ALIGNED) * _ALIGNED
    return header, arrays
