"""Files in glTF as other programs read them (test support)."""

import base64
import io
import json
import shutil
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from sound.export.gltf_asset import UNSIGNED_INT
from tests.programs import CHECKOUT, run

VALIDATOR = CHECKOUT / "build/page-types/node_modules/gltf-validator"
"""Khronos' validator, where `.ci/page/check` installs it."""
_VALIDATE = """
import { createRequire } from "node:module";
import { readFileSync } from "node:fs";
const [validator, path] = process.argv.slice(-2);
const { validateBytes } = createRequire(validator)(validator);
const bytes = new Uint8Array(readFileSync(path));
console.log(JSON.stringify((await validateBytes(bytes)).issues));
"""
HARMLESS = ("UNSUPPORTED_EXTENSION", "UNUSED_OBJECT")
"""What the validator says of extensions that it does not know, and of what they alone use."""
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


def validated(path: Path) -> None:
    """Check a file by Khronos' validator: no errors, no warnings, nothing told but `HARMLESS`.

    Skips the test where the validator is not installed.
    """
    if shutil.which("node") is None:
        pytest.skip("node is not installed")
    if not VALIDATOR.is_dir():
        pytest.skip("npm's gltf-validator is not installed, .ci/page/check does so")
    words = ("node", "--input-type=module", "-e", _VALIDATE, "--", VALIDATOR, path)
    found = json.loads(run(*words, check=True).stdout)
    assert found["numErrors"] == found["numWarnings"] == 0, found["messages"]
    others = [each for each in found["messages"] if each["code"] not in HARMLESS]
    assert others == [] and not found["truncated"]


def sound_of(
    document: dict[str, Any], data: bytes, audio: dict[str, Any]
) -> tuple[np.ndarray, int]:
    """Samples and rate of an entry `audio` of KHR_audio_emitter."""
    assert audio["mimeType"] == "audio/mpeg"
    view = document["bufferViews"][audio["bufferView"]]
    content = data[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
    return soundfile.read(io.BytesIO(content))


def rms(samples: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(samples**2)))
