"""Files of a few kilobytes or megabytes that stand for gigabytes, or for work without end."""

from __future__ import annotations

import json
import shutil
import zlib
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from tests.edited_files import edited
from tests.mesh_files import Gltf, block

SIDECAR, LARGE_SIDECAR = 300 << 20, 3 << 30
"""Bytes of files beside meshes, which are holes."""
MANY = 100_000_000
TIMES, TEXT_BYTES = 3000, 1_000_000
"""How often a text is named, and how long it is."""
LEVELS = 40
CHUNK = 1 << 26
"""Numbers of a chunk."""

BOX = block((0.0, 0.0, 0.0), (0.2, 0.1, 0.1))


def make(folder: Path) -> None:
    """Write `MESHES`, what they name, and `FILES`, which are made of the modes file `modes.h5`."""
    _hole(folder / "pictures.bin", SIDECAR)
    _hole(folder / "large.bin", LARGE_SIDECAR)
    for name, mesh in MESHES.items():
        mesh(folder / name)
    for name, change in FILES.items():
        path = Path(shutil.copy(folder / "modes.h5", folder / name))
        change(path)
        with edited(path):
            pass


def _hole(path: Path, length: int) -> None:
    with open(path, "wb") as stream:
        stream.truncate(length)


# Meshes -------------------------------------------------------------------------------------------


def box_gltf() -> Gltf:
    """A box as glTF."""
    return gltf(np.asarray(BOX.vertices), np.asarray(BOX.faces))


def gltf(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> Gltf:
    """Triangles as glTF."""
    file = Gltf()
    file.primitive["attributes"]["POSITION"] = file.accessor(vertices, 5126)
    file.primitive["indices"] = file.accessor(faces.ravel(), 5125)
    return file


def _zeros(path: Path) -> None:
    """Positions that are nowhere, which stand for zeros."""
    file = box_gltf()
    del file.header["accessors"][0]["bufferView"]
    file.header["accessors"][0]["count"] = MANY
    file.written(path)


def _sparse(path: Path) -> None:
    """Zeros, some of which are replaced."""
    file = box_gltf()
    accessor = file.header["accessors"][0]
    view = accessor.pop("bufferView")
    indices = {"bufferView": file.view(np.arange(8, dtype="<u4")), "componentType": 5125}
    accessor["sparse"] = {"count": 8, "indices": indices, "values": {"bufferView": view}}
    accessor["count"] = MANY
    file.written(path)


def _instances(path: Path) -> None:
    """One mesh at many nodes."""
    fine = BOX.subdivide().subdivide().subdivide().subdivide()
    file = gltf(np.asarray(fine.vertices), np.asarray(fine.faces))
    file.header["nodes"] = [{"mesh": 0}] * 20_000
    file.header["scenes"] = [{"nodes": list(range(20_000))}]
    file.written(path)


def _views(path: Path) -> None:
    """Many views of one buffer, which no triangle uses."""
    file = box_gltf()
    file.data += bytes(1 << 20)
    file.header["bufferViews"] += [{"buffer": 0, "byteLength": 1 << 20}] * 5000
    file.written(path)


def _chain(path: Path) -> None:
    """Nodes in nodes, each of whose places is a product of all those above it."""
    file = box_gltf()
    count = 20_000
    nodes = [{"mesh": 0, "children": [number + 1]} for number in range(count - 1)]
    file.header["nodes"] = [*nodes, {"mesh": 0}]
    file.written(path)


def _circle(path: Path) -> None:
    file = box_gltf()
    file.header["nodes"] = [{"mesh": 0, "children": [1]}, {"children": [0]}]
    file.written(path)


def _rows(path: Path) -> None:
    """Rows that overlap."""
    file = box_gltf()
    file.header["bufferViews"][0]["byteStride"] = 1
    file.written(path)


def _large_buffer(path: Path) -> None:
    file = box_gltf()
    path = Path(file.written(path))
    header = json.loads(path.read_text())
    header["buffers"] = [{"byteLength": LARGE_SIDECAR, "uri": "large.bin"}]
    path.write_text(json.dumps(header))


def _picture(path: Path) -> None:
    file = box_gltf()
    file.header["images"] = [{"uri": "pictures.bin"}]
    file.header["textures"] = [{"source": 0}]
    file.header["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    file.primitive["material"] = 0
    file.written(path)


def _materials(path: Path) -> None:
    path.write_text("mtllib pictures.bin\n" + str(BOX.export(file_type="obj")))


def _texture(path: Path) -> None:
    named = b"comment TextureFile pictures.bin\nend_header"
    path.write_bytes(BOX.export(file_type="ply").replace(b"end_header", named, 1))


MESHES: dict[str, Callable[[Path], None]] = {
    "grows-materials.obj": _materials,
    "grows-texture.ply": _texture,
    "grows-picture.gltf": _picture,
    "grows-buffer.gltf": _large_buffer,
    "grows-views.glb": _views,
    "grows-zeros.glb": _zeros,
    "grows-sparse.glb": _sparse,
    "grows-instances.glb": _instances,
    "grows-chain.glb": _chain,
    "grows-circle.glb": _circle,
    "grows-rows.glb": _rows,
    "grows-parts.3mf": lambda path: path.write_bytes(b"PK\3\4"),
    "grows-parts.dae": lambda path: path.write_text("<COLLADA/>"),
}
"""Names of meshes, and what writes them."""


# HDF5 files ---------------------------------------------------------------------------------------


def _tree(path: Path) -> None:
    """A group with two names in each level: twice as many ways to the last level as to that before.

    The names are the same object, so the file grows by a kilobyte a level.
    """
    with h5py.File(path, "r+") as file:
        group = file.create_group("tree")
        for _ in range(LEVELS):
            inner = group.create_group("a")
            group["b"] = inner
            group = inner


def _deep(path: Path) -> None:
    with h5py.File(path, "r+") as file:
        file.create_group("/".join(["in"] * 100))


def _circle_of_groups(path: Path) -> None:
    with h5py.File(path, "r+") as file:
        inner = file.create_group("a/b")
        inner["a"] = file["a"]


def _texts(path: Path) -> None:
    """Many texts of a dataset that are one."""
    with h5py.File(path, "r+") as file:
        del file["residuals"]
        texts = file.create_dataset("residuals", (TIMES,), h5py.string_dtype())
        texts[0] = "x" * TEXT_BYTES
        texts[1:] = "y"
        place = texts.id.get_offset()
    _repeat(path, place)


def _texts_beside(path: Path) -> None:
    """The same of an attribute."""
    with h5py.File(path, "r+") as file:
        values = ["x" * TEXT_BYTES, *["y"] * (TIMES - 1)]
        file["provenance"].attrs.create("texts", values, dtype=h5py.string_dtype())
    _repeat(path, _attribute(path.read_bytes()))


def _texts_apart(path: Path) -> None:
    """Attributes of one text each, which are one."""
    with h5py.File(path, "r+") as file:
        group = file["provenance"]
        for number in range(500):
            group.attrs[f"text {number}"] = "x" * TEXT_BYTES if number == 0 else "y" * 77
    content = bytearray(path.read_bytes())
    first = _attribute(content)
    named = content[first : first + 16]
    at = content.find(_length(77))
    while at >= 0:
        if _is_named(content, at):
            content[at : at + 16] = named
        at = content.find(_length(77), at + 4)
    path.write_bytes(content)


def _kind(path: Path) -> None:
    """The same of what the file says it is, which is looked at before all else."""
    with h5py.File(path, "r+") as file:
        values = ["x" * TEXT_BYTES, *["y"] * (TIMES - 1)]
        file.attrs.create("kind", values, dtype=h5py.string_dtype())
    _repeat(path, _attribute(path.read_bytes()))


def _attribute(content: bytes | bytearray) -> int:
    """Where the one long text is named: its length, the place of its heap, its number there."""
    at = content.find(_length(TEXT_BYTES))
    while not _is_named(content, at):
        at = content.find(_length(TEXT_BYTES), at + 1)
    return at


def _is_named(content: bytes | bytearray, at: int) -> bool:
    place = int.from_bytes(content[at + 4 : at + 12], "little")
    return 0 < place < len(content) and content[place + 512 : place + 516] == b"GCOL"


def _length(count: int) -> bytes:
    return count.to_bytes(4, "little")


def _repeat(path: Path, place: int) -> None:
    """Let all the texts of a row be the first one."""
    content = bytearray(path.read_bytes())
    content[place : place + 16 * TIMES] = content[place : place + 16] * TIMES
    path.write_bytes(content)


def _chunks(path: Path) -> None:
    """One number, in a chunk of zeros that was compressed to a thousandth."""
    with h5py.File(path, "r+") as file:
        del file["residuals"]
        wide = file.create_dataset(
            "residuals", (1,), maxshape=(None,), chunks=(CHUNK,), dtype="f8", compression="gzip"
        )
        wide.id.write_direct_chunk((0,), _deflated_zeros(8 * CHUNK))


def _deflated_zeros(count: int) -> bytes:
    """What zlib makes of a multiple of 2^20 zeros, without the zeros."""
    squeeze = zlib.compressobj(9, zlib.DEFLATED, -15)
    piece = squeeze.compress(bytes(1 << 20)) + squeeze.flush(zlib.Z_FULL_FLUSH)
    check = (count % 65521) << 16 | 1
    return b"\x78\xda" + piece * (count >> 20) + squeeze.flush() + check.to_bytes(4, "big")


def _filled(path: Path) -> None:
    """Numbers that were never written, which stand for one."""
    with h5py.File(path, "r+") as file:
        del file["residuals"]
        file.create_dataset("residuals", (10**12,), "f8", fillvalue=1.0, chunks=(1 << 20,))


def _overflow(path: Path) -> None:
    """A shape whose product is 0 for a machine."""
    with h5py.File(path, "r+") as file:
        del file["residuals"]
        file.create_dataset("residuals", (1 << 33, 1 << 33), "f8", chunks=(8, 8))


def _nothing(path: Path) -> None:
    """No numbers, in more rows than can be counted."""
    with h5py.File(path, "r+") as file:
        del file["residuals"]
        file.create_dataset("residuals", (0, 1 << 60), "f8", chunks=(1, 8), maxshape=(None, None))


def _lists(path: Path) -> None:
    with h5py.File(path, "r+") as file:
        del file["residuals"]
        lists = file.create_dataset("residuals", (2,), h5py.vlen_dtype(np.float64))
        lists[0] = np.ones(3)


def _references(path: Path) -> None:
    with h5py.File(path, "r+") as file:
        del file["residuals"]
        file.create_dataset("residuals", data=[file.ref, file.ref], dtype=h5py.ref_dtype)


FILES: dict[str, Callable[[Path], None]] = {
    "grows-tree.h5": _tree,
    "grows-deep.h5": _deep,
    "grows-circle.h5": _circle_of_groups,
    "grows-texts.h5": _texts,
    "grows-attribute.h5": _texts_beside,
    "grows-attributes.h5": _texts_apart,
    "grows-kind.h5": _kind,
    "grows-chunks.h5": _chunks,
    "grows-filled.h5": _filled,
    "grows-overflow.h5": _overflow,
    "grows-nothing.h5": _nothing,
    "grows-lists.h5": _lists,
    "grows-references.h5": _references,
}
"""Names of modes files, and what is changed of them."""
