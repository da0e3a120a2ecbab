"""Objects of 3MF files, by name (3MF Consortium: Core Specification 1.3).

A 3MF file is an archive of XML, whose objects hold others, so that a few bytes can stand for any
number: how long members are is looked at before they are read, and how many triangles objects are
before these are put in their places.
"""

from __future__ import annotations

import io
import posixpath
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from xml.etree import ElementTree

import numpy as np

from carillon.arrays import Array, Index
from carillon.errors import UserError
from carillon.fem.geometry.scene_parts import Part
from carillon.limits import MESH_BYTES

SMALL, GROWTH = 1 << 27, 64
"""Bytes that the members of any file may have, and how often its own length those of a longer
one."""
MOST_TRIANGLES, REPEATED = 2_000_000, 8
"""Triangles that the objects of any file may stand for, and how often its own number more."""
DEEPEST = 64
"""Objects inside each other."""
_ENDING = ".model"

Key = tuple[str, str]
"""Member of the archive and number of an object in there."""


@dataclass
class _Object:
    name: str = ""
    vertices: Array = field(default_factory=lambda: np.empty((0, 3)))
    faces: Index = field(default_factory=lambda: np.empty((0, 3), dtype=np.int64))
    inner: list[tuple[Key, Array]] = field(default_factory=list)
    """Objects in it and their places (4, 3)."""


@dataclass
class _Model:
    objects: dict[Key, _Object] = field(default_factory=dict)
    items: list[tuple[Key, Array, str]] = field(default_factory=list)
    """Objects that are built, their places and what they are called there."""


def three_mf_parts(content: bytes, path: str) -> list[Part]:
    """The objects that a 3MF file builds; those that consist of others are these, each by itself.

    Coordinates are the file's. Raises UserError if the file stands for far more bytes or triangles
    than it has, and exceptions of any kind if it is no 3MF file.
    """
    model = _Model()
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = [each for each in archive.infolist() if each.filename.endswith(_ENDING)]
        length = sum(each.file_size for each in members)
        most = min(MESH_BYTES, SMALL + GROWTH * len(content))
        if length > most:
            raise UserError(
                f"{path}: its models would take {length:,} bytes in a file of {len(content):,}, "
                f"expected at most {most:,}; simplify the mesh"
            )
        root = _root(archive, members)
        for member in members:
            with archive.open(member) as stream:
                xml = stream.read(member.file_size + 1)
            _read(xml, f"/{member.filename.lstrip('/')}", model, member.filename == root)
    _require_proportion(model, path)
    parts: list[Part] = []
    for key, place, called in model.items:
        for leaf, own in _leaves(model, key, place):
            name = leaf.name or model.objects[key].name or called
            parts.append(Part(name, leaf.vertices @ own[:3] + own[3], leaf.faces))
    return parts


def _root(archive: zipfile.ZipFile, members: list[zipfile.ZipInfo]) -> str:
    """The member that says what is built: the others hold objects for it."""
    names = [each.filename for each in members]
    usual = [name for name in names if name.lstrip("/") == "3D/3dmodel.model"]
    if usual or len(names) == 1:
        return (usual or names)[0]
    relations = archive.getinfo("_rels/.rels")
    if relations.file_size > SMALL:
        raise ValueError("its relations are too long")
    for each in ElementTree.fromstring(_plain(archive.read(relations))):
        if each.get("Type", "").endswith("/3dmodel"):
            target = each.get("Target", "").lstrip("/")
            return next(name for name in names if name.lstrip("/") == target)
    raise ValueError("it says no model")


def _plain(xml: bytes) -> bytes:
    if b"<!DOCTYPE" in xml[:4096] or b"<!ENTITY" in xml[:65536]:
        raise ValueError("it defines entities, which no model needs")
    return xml


def _read(xml: bytes, member: str, model: _Model, is_root: bool) -> None:
    now, vertices, faces = _Object(), list[str](), list[str]()
    for event, element in ElementTree.iterparse(io.BytesIO(_plain(xml)), ("start", "end")):
        tag = element.tag.rpartition("}")[2]
        if event == "start":
            if tag == "object":
                now, vertices, faces = _Object(element.get("name", "")), [], []
            continue
        if tag == "vertex":
            vertices += element.attrib["x"], element.attrib["y"], element.attrib["z"]
        elif tag == "triangle":
            faces += element.attrib["v1"], element.attrib["v2"], element.attrib["v3"]
        elif tag == "component":
            now.inner.append((_named(element, member), _place(element)))
        elif tag == "item" and is_root:
            item = _named(element, member), _place(element), element.get("partnumber", "")
            model.items.append(item)
        elif tag == "object" and element.get("type", "model") in ("model", "solidsupport"):
            now.vertices = np.array(vertices, dtype=float).reshape(-1, 3)
            now.faces = np.array(faces, dtype=np.int64).reshape(-1, 3)
            if now.faces.size and not 0 <= now.faces.min() <= now.faces.max() < len(now.vertices):
                raise ValueError(f"a triangle names vertex {now.faces.max()}, which is not there")
            model.objects[member, element.attrib["id"]] = now
        if tag in ("vertex", "triangle", "mesh", "object"):
            element.clear()


def _named(element: ElementTree.Element, member: str) -> Key:
    """The object that a component or an item names, in another member if it says so."""
    path = next((value for name, value in element.attrib.items() if name.endswith("}path")), member)
    return posixpath.join("/", path), element.attrib["objectid"]


def _place(element: ElementTree.Element) -> Array:
    """Rows (4, 3) that a position with a one behind it is multiplied by."""
    text = element.get("transform")
    if text is None:
        return np.eye(4)[:, :3]
    values = np.array([float(word) for word in text.split()])
    return values.reshape(4, 3)


def _leaves(model: _Model, key: Key, place: Array) -> Iterator[tuple[_Object, Array]]:
    """Objects with triangles that an object is, itself or those in it, and their places."""
    own = model.objects[key]
    if len(own.faces):
        yield own, place
    for other, inner in own.inner:
        composed = np.concatenate([inner[:3] @ place[:3], (inner[3] @ place[:3] + place[3])[None]])
        yield from _leaves(model, other, composed)


def _require_proportion(model: _Model, path: str) -> None:
    """Check that objects are not in themselves, and how many triangles they stand for."""
    counts: dict[Key, int] = {}

    def count(key: Key, depth: int) -> int:
        if depth > DEEPEST:
            raise ValueError(f"its objects are more than {DEEPEST} deep, or in themselves")
        if key not in counts:
            own = model.objects[key]
            inner = sum(count(other, depth + 1) for other, _ in own.inner)
            counts[key] = max(len(own.faces) + inner, 1)
        return counts[key]

    total = sum(count(key, 0) for key, *_ in model.items)
    there = sum(len(each.faces) for each in model.objects.values())
    if total > MOST_TRIANGLES + REPEATED * there:
        raise UserError(
            f"{path}: its objects stand for {total:,} triangles, far more than the {there:,} of "
            "the file; leave out parts, or export one part alone"
        )
