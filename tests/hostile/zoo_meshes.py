"""Meshes: a valid box in several formats, and files that are broken or absurd."""

import json
import struct
from pathlib import Path

import numpy as np
import trimesh

SIDES = (0.2, 0.15, 0.1)
VALID_NAMES = (
    *("box.obj", "my box.obj", "-box.obj", "bo'x\".obj", "böx 箱.obj", "{box}.obj"),
    *("$(touch x).obj", "a;b.obj", "line\nbreak.obj", "box.OBJ", "%s.obj", "*.obj"),
)
"""The same box under names that programs stumble over."""


def make(folder: Path) -> None:
    """Write all meshes to `folder`."""
    box = trimesh.creation.box(SIDES)
    text = _obj(box.vertices, box.faces)
    for name in VALID_NAMES:
        (folder / name).write_text(text)
    for end in ("stl", "ply", "glb", "off"):
        box.export(folder / f"box.{end}")
    _make_broken(folder, text)
    _make_absurd(folder, box)
    _make_liars(folder)


VOLUMES = ("msh", "vtu", "vtk", "inp", "med", "mesh")
"""Endings of meshes with volume elements."""


def _make_broken(folder: Path, text: str) -> None:
    random = np.random.default_rng(0)
    for end in ("obj", "stl", "ply", "glb", "off", "gltf", "3mf", *VOLUMES):
        (folder / f"empty.{end}").touch()
        (folder / f"junk.{end}").write_bytes(random.bytes(4096))
    for end in ("stl", "ply", "glb"):
        content = (folder / f"box.{end}").read_bytes()
        (folder / f"cut.{end}").write_bytes(content[: len(content) * 2 // 3])
    (folder / "box.xyzzy").write_text(text)
    (folder / "box").write_text(text)
    (folder / "words.obj").write_text("v one two three\nf a b c\n")
    (folder / "range.obj").write_text(text + "f 1 2 999999\n")
    (folder / "below.obj").write_text(text + "f 1 2 -999999\n")
    (folder / "index.obj").write_text(text + f"f 1 2 {10**18}\n")
    (folder / "points.obj").write_text("".join(line + "\n" for line in text.split("\n")[:8]))
    for name, value in (("nan", "nan"), ("inf", "inf"), ("beyond", "1e400")):
        lines = text.split("\n")
        lines[0] = f"v {value} 0 0"
        (folder / f"{name}.obj").write_text("\n".join(lines))
    (folder / "latin.obj").write_bytes("# Körper\n".encode("latin-1") + b"v 0 0\n")
    (folder / "nul.obj").write_bytes(text.replace("v ", "v \0 ", 1).encode())


def _make_absurd(folder: Path, box: trimesh.Trimesh) -> None:
    vertices, faces = np.asarray(box.vertices), np.asarray(box.faces)
    shapes = {
        "flat": (vertices * [1, 1, 0], faces),
        "line": (vertices * [1, 0, 0], faces),
        "point": (vertices * 0, faces),
        "triangle": (np.array([[0, 0, 0], [1, 0, 0.2], [0, 1, 0.7]]), np.array([[0, 1, 2]])),
        "degenerate": (vertices, np.zeros_like(faces)),
        "huge": (vertices * 1e200, faces),
        "largest": (vertices * 1e308, faces),
        "tiny": (vertices * 1e-300, faces),
        "far": (vertices / vertices.max() + 1e15, faces),
        "twice": (vertices, np.concatenate([faces, faces])),
        "inside-out": (vertices, faces[:, ::-1]),
        "needle": (vertices * [1e5, 1, 1], faces),
        "apart": (
            np.concatenate([vertices, vertices + 1.0]),
            np.concatenate([faces, faces + len(vertices)]),
        ),
    }
    for name, (at, triangles) in shapes.items():
        (folder / f"{name}.obj").write_text(_obj(at, triangles))


def _make_liars(folder: Path) -> None:
    """Heads that promise more than there is."""
    (folder / "claims.stl").write_bytes(struct.pack("<80sI", b"", 2**31 - 1) + bytes(50))
    (folder / "claims.ply").write_text(
        "ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\n"
        "property float y\nproperty float z\nelement face 4000000000\n"
        "property list uchar int vertex_indices\nend_header\n"
    )
    (folder / "claims.off").write_text("OFF\n4000000000 4000000000 0\n0 0 0\n")
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 0}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 10**15, "type": "VEC3"},
        ],
        "bufferViews": [{"buffer": 0, "byteLength": 10**15}],
        "buffers": [{"byteLength": 10**15}],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sII", b"glTF", 2, 2**31 - 1)
    (folder / "claims.glb").write_bytes(head + struct.pack("<I4s", len(text), b"JSON") + text)
    document["buffers"] = [{"byteLength": 100, "uri": "file:///etc/passwd"}]
    (folder / "foreign.gltf").write_text(json.dumps(document))
    document["buffers"] = [{"byteLength": 100, "uri": "../../../../../etc/passwd"}]
    (folder / "relative.gltf").write_text(json.dumps(document))


def _obj(vertices: np.ndarray, faces: np.ndarray) -> str:
    lines = ["v " + " ".join(repr(float(x)) for x in vertex) for vertex in vertices]
    lines += ["f " + " ".join(str(int(i) + 1) for i in face) for face in faces]
    return "\n".join(lines) + "\n"
