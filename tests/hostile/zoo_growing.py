"""Files of a few kilobytes or megabytes that stand for gigabytes, or for work without end."""

import json
import os
import shutil
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np

from tests.edited_files import reseal
from tests.mesh_files import Gltf, block, gltf

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
    """Write all meshes, what they name, and `FILES`, made of the modes file `modes.h5`."""
    for name, length in (("pictures.bin", SIDECAR), ("large.bin", LARGE_SIDECAR)):
        (folder / name).touch()
        os.truncate(folder / name, length)
    for name, change in BOXES.items():
        file = gltf(BOX)
        change(file)
        file.written(folder / name)
    for name, write in MESHES.items():
        write(folder / name)
    for name, change in FILES.items():
        path = Path(shutil.copy(folder / "modes.h5", folder / name))
        with h5py.File(path, "r+") as file:
            after = change(file)
        if callable(after):
            after(path)
        reseal(path)


# Meshes -------------------------------------------------------------------------------------------


def _zeros(file: Gltf) -> None:
    """Positions that are nowhere, which stand for zeros."""
    del file.header["accessors"][0]["bufferView"]
    file.header["accessors"][0]["count"] = MANY


def _sparse(file: Gltf) -> None:
    """Zeros, some of which are replaced."""
    accessor = file.header["accessors"][0]
    view = accessor.pop("bufferView")
    indices = {"bufferView": file.view(np.arange(8, dtype="<u4")), "componentType": 5125}
    accessor["sparse"] = {"count": 8, "indices": indices, "values": {"bufferView": view}}
    accessor["count"] = MANY


def _views(file: Gltf) -> None:
    """Many views of one buffer, which no triangle uses."""
    file.data += bytes(1 << 20)
    file.header["bufferViews"] += [{"buffer": 0, "byteLength": 1 << 20}] * 5000


def _chain(file: Gltf) -> None:
    """Nodes in nodes, each of whose places is a product of all those above it."""
    nodes = [{"mesh": 0, "children": [number]} for number in range(1, 20_000)]
    file.header["nodes"] = [*nodes, {"mesh": 0}]


def _circle(file: Gltf) -> None:
    file.header["nodes"] = [{"mesh": 0, "children": [1]}, {"children": [0]}]


def _rows(file: Gltf) -> None:
    """Rows that overlap."""
    file.header["bufferViews"][0]["byteStride"] = 1


def _picture(file: Gltf) -> None:
    file.header["images"] = [{"uri": "pictures.bin"}]
    file.header["textures"] = [{"source": 0}]
    file.header["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    file.primitive["material"] = 0


def _instances(path: Path) -> None:
    """One mesh at many nodes."""
    file = gltf(BOX.subdivide().subdivide().subdivide().subdivide())
    file.header["nodes"] = [{"mesh": 0}] * 20_000
    file.header["scenes"] = [{"nodes": list(range(20_000))}]
    file.written(path)


def _large_buffer(path: Path) -> None:
    path = Path(gltf(BOX).written(path))
    header = json.loads(path.read_text())
    header["buffers"] = [{"byteLength": LARGE_SIDECAR, "uri": "large.bin"}]
    path.write_text(json.dumps(header))


def _texture(path: Path) -> None:
    named = b"comment TextureFile pictures.bin\nend_header"
    path.write_bytes(BOX.export(file_type="ply").replace(b"end_header", named, 1))


def _model_archive(path: Path, text: str) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("3D/3dmodel.model", text)


def _objects(path: Path) -> None:
    """Objects in objects, two of each in the next: twice as many triangles with each."""
    space = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
    vertices = "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in BOX.vertices)
    triangles = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in BOX.faces)
    mesh = f"<mesh><vertices>{vertices}</vertices><triangles>{triangles}</triangles></mesh>"
    objects = [f'<object id="0">{mesh}</object>']
    for number in range(1, LEVELS):
        inner = f'<component objectid="{number - 1}"/>' * 2
        objects.append(f'<object id="{number}"><components>{inner}</components></object>')
    _model_archive(
        path,
        f'<model xmlns="{space}" unit="meter"><resources>{"".join(objects)}</resources>'
        f'<build><item objectid="{LEVELS - 1}"/></build></model>',
    )


def _blanks(path: Path) -> None:
    _model_archive(path, "<model>" + " " * (1 << 28) + "</model>")


def _vtu(path: Path, points: int, blocks: bytes) -> None:
    path.write_bytes(
        b'<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" '
        b'header_type="UInt64" compressor="vtkZLibDataCompressor"><UnstructuredGrid>'
        + f'<Piece NumberOfPoints="{points}" NumberOfCells="0"><Points>'.encode()
        + b'<DataArray type="Float64" NumberOfComponents="3" format="appended" offset="0"/>'
        b"</Points></Piece></UnstructuredGrid>"
        b'<AppendedData encoding="raw">_' + blocks + b"</AppendedData></VTKFile>"
    )


def _points(path: Path) -> None:
    """More points than fit into memory."""
    _vtu(path, 10**12, b"")


def _blocks(path: Path) -> None:
    """A compressed block that is far longer than its header says."""
    block = zlib.compress(bytes(1 << 30))
    _vtu(path, 1, struct.pack("<4Q", 1, 24, 0, len(block)) + block)


BOXES: dict[str, Callable[[Gltf], None]] = {
    "grows-picture.gltf": _picture,
    "grows-views.glb": _views,
    "grows-zeros.glb": _zeros,
    "grows-sparse.glb": _sparse,
    "grows-chain.glb": _chain,
    "grows-circle.glb": _circle,
    "grows-rows.glb": _rows,
}
"""Names of files of a box, and what is changed of it."""
MESHES: dict[str, Callable[[Path], object]] = {
    "grows-materials.obj": lambda path: path.write_text(
        "mtllib pictures.bin\n" + str(BOX.export(file_type="obj"))
    ),
    "grows-texture.ply": _texture,
    "grows-buffer.gltf": _large_buffer,
    "grows-instances.glb": _instances,
    "grows-parts.3mf": _objects,
    "grows-text.3mf": _blanks,
    "grows-points.vtu": _points,
    "grows-blocks.vtu": _blocks,
    "grows-image.vtk": lambda path: path.write_text(
        "# vtk DataFile Version 4.2\n.\nASCII\nDATASET STRUCTURED_POINTS\n"
        "DIMENSIONS 9999 9999 9999\nORIGIN 0 0 0\nSPACING 1 1 1\n"
    ),
    "grows-nodes.msh": lambda path: path.write_text(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n99999999999\n1 0 0 0\n$EndNodes\n"
    ),
    "grows-parts.dae": lambda path: path.write_text("<COLLADA/>"),
}
"""Names of other meshes, and what writes them."""


# HDF5 files ---------------------------------------------------------------------------------------

After = Callable[[Path], None]
"""What is done to a file once it is closed."""


def _tree(file: h5py.File) -> None:
    """A group with two names in each level: twice as many ways to the last level as to that before.

    The names are the same object, so the file grows by a kilobyte a level.
    """
    group = file.create_group("tree")
    for _ in range(LEVELS):
        inner = group.create_group("a")
        group["b"] = inner
        group = inner


def _circle_of_groups(file: h5py.File) -> None:
    inner = file.create_group("a/b")
    inner["a"] = file["a"]


def _residuals(file: h5py.File, *shape: object, **how: object) -> h5py.Dataset:
    """Another dataset in place of the residuals."""
    del file["residuals"]
    return file.create_dataset("residuals", *shape, **how)


def _texts(file: h5py.File) -> After:
    """Many texts of a dataset that are one."""
    texts = _residuals(file, (TIMES,), h5py.string_dtype())
    texts[0] = "x" * TEXT_BYTES
    texts[1:] = "y"
    place = texts.id.get_offset()
    return lambda path: _repeat(path, place)


def _attribute_of_texts(group: h5py.Group, name: str) -> After:
    """The same of an attribute."""
    values = ["x" * TEXT_BYTES, *["y"] * (TIMES - 1)]
    group.attrs.create(name, values, dtype=h5py.string_dtype())
    return lambda path: _repeat(path, _attribute(path.read_bytes()))


def _texts_apart(file: h5py.File) -> After:
    """Attributes of one text each, which are one."""
    for number in range(500):
        text = "x" * TEXT_BYTES if number == 0 else "y" * 77
        file["provenance"].attrs[f"text {number}"] = text
    return _name_the_first


def _name_the_first(path: Path) -> None:
    content = bytearray(path.read_bytes())
    first = _attribute(content)
    named = content[first : first + 16]
    at = content.find(_length(77))
    while at >= 0:
        if _is_named(content, at):
            content[at : at + 16] = named
        at = content.find(_length(77), at + 4)
    path.write_bytes(content)


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


def _chunks(file: h5py.File) -> None:
    """One number, in a chunk of zeros that was compressed to a thousandth."""
    how = {"maxshape": (None,), "chunks": (CHUNK,), "dtype": "f8", "compression": "gzip"}
    _residuals(file, (1,), **how).id.write_direct_chunk((0,), _deflated_zeros(8 * CHUNK))


def _deflated_zeros(count: int) -> bytes:
    """What zlib makes of a multiple of 2^20 zeros, without the zeros."""
    squeeze = zlib.compressobj(9, zlib.DEFLATED, -15)
    piece = squeeze.compress(bytes(1 << 20)) + squeeze.flush(zlib.Z_FULL_FLUSH)
    check = (count % 65521) << 16 | 1
    return b"\x78\xda" + piece * (count >> 20) + squeeze.flush() + check.to_bytes(4, "big")


def _lists(file: h5py.File) -> None:
    _residuals(file, (2,), h5py.vlen_dtype(np.float64))[0] = np.ones(3)


FILES: dict[str, Callable[[h5py.File], object]] = {
    "grows-tree.h5": _tree,
    "grows-deep.h5": lambda file: file.create_group("/".join(["in"] * 100)),
    "grows-circle.h5": _circle_of_groups,
    "grows-texts.h5": _texts,
    "grows-attribute.h5": lambda file: _attribute_of_texts(file["provenance"], "texts"),
    "grows-attributes.h5": _texts_apart,
    # What the file says it is, which is looked at before all else.
    "grows-kind.h5": lambda file: _attribute_of_texts(file, "kind"),
    "grows-chunks.h5": _chunks,
    # Numbers that were never written, which stand for one.
    "grows-filled.h5": lambda file: _residuals(
        file, (10**12,), "f8", fillvalue=1.0, chunks=(1 << 20,)
    ),
    # A shape whose product is 0 for a machine.
    "grows-overflow.h5": lambda file: _residuals(file, (1 << 33, 1 << 33), "f8", chunks=(8, 8)),
    # No numbers, in more rows than can be counted.
    "grows-nothing.h5": lambda file: _residuals(
        file, (0, 1 << 60), "f8", chunks=(1, 8), maxshape=(None, None)
    ),
    "grows-lists.h5": _lists,
    "grows-references.h5": lambda file: _residuals(
        file, data=[file.ref, file.ref], dtype=h5py.ref_dtype
    ),
}
"""Names of modes files, and what is changed of them."""
