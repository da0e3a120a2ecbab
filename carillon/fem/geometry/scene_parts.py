"""Parts of a scene in a file, by the names that they have there: glTF and OBJ."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array, Index
from carillon.fem.geometry.facets import Facets
from carillon.fem.geometry.gltf import STRIP, Header, ReadBeside, opened_gltf
from carillon.fem.geometry.plain_files import obj_lines, vertex_number


@dataclass(frozen=True, eq=False)
class Part:
    """Triangles of a part."""

    name: str
    vertices: Array
    """(v, 3)."""
    faces: Index
    """(f, 3)."""


def is_closed(vertices: Array, faces: Index) -> bool:
    """Whether each edge of the faces has an even number of them, turned as they may be."""
    facets = Facets.of_surface(vertices, faces)
    return len(facets) > 0 and not (facets.edges[2] % 2).any()


def part_of(name: str, vertices: Array, faces: Index) -> Part:
    """A part with those of the vertices (v, 3) alone that its faces (f, 3) have."""
    used, corners = np.unique(faces, return_inverse=True)
    return Part(name, vertices[used], corners.reshape(-1, 3))


def split(part: Part, names: Sequence[Sequence[str]], labels: Index) -> list[Part]:
    """A part by what its faces are labelled, as finely as leaves closed surfaces.

    `labels` (f,) are rows of `names`, whose columns are tried together, then one after the other.
    """
    there, row = np.unique(labels, return_inverse=True)
    columns = tuple(range(len(names[0])))
    for chosen in [columns, *((column,) for column in columns)]:
        texts = ["/".join(names[k][c] for c in chosen if names[k][c]) for k in there]
        distinct = {text: number for number, text in enumerate(dict.fromkeys(texts))}
        groups = [
            part_of("/".join(filter(None, (part.name, text))), part.vertices, part.faces[own])
            for text, own in zip(
                distinct, _members(np.array([distinct[text] for text in texts])[row.ravel()])
            )
        ]
        if len(groups) > 1 and all(is_closed(each.vertices, each.faces) for each in groups):
            return groups
    return [part]


def _members(number: Index) -> list[Index]:
    """Which rows have each number, from 0 on."""
    order = np.argsort(number, kind="stable")
    return np.split(order, np.cumsum(np.bincount(number))[:-1])


def obj_parts(content: bytes) -> list[Part]:
    """The objects of an OBJ file, by groups and materials where these are closed surfaces.

    Raises ValueError if a vertex does not have three coordinates, or a face names one that is not
    there.

    Examples
    --------
    >>> [part.name for part in obj_parts(b"v 0 0 0\\nv 1 0 0\\nv 0 1 0\\no flat\\nf 1 2 3\\n")]
    ['flat']
    """
    vertices: list[list[str]] = []
    corners: list[int] = []
    label_of: list[int] = []
    rows: dict[tuple[str, str, str], int] = {}
    now = {"o": "", "g": "", "usemtl": ""}
    label = rows.setdefault(("", "", ""), 0)
    for keyword, words in obj_lines(content):
        if keyword == "v":
            if len(words) < 3:
                raise ValueError("a vertex does not have three coordinates")
            vertices.append(words[:3])
        elif keyword == "f":
            around = [vertex_number(word, len(vertices)) - 1 for word in words]
            for second, third in zip(around[1:], around[2:]):
                corners += around[0], second, third
                label_of.append(label)
        elif keyword in now:
            now[keyword] = " ".join(words).encode("latin-1").decode("utf-8", "replace")
            label = rows.setdefault((now["o"], now["g"], now["usemtl"]), len(rows))
    points = np.array(vertices, dtype=float).reshape(-1, 3)
    faces = np.array(corners, dtype=np.int64).reshape(-1, 3)
    if faces.size and not 0 <= faces.min() <= faces.max() < len(points):
        raise ValueError(f"a face names vertex {faces.max() + 1}, there are 1 to {len(points)}")
    names, row = list(rows), np.array(label_of, dtype=np.int64)
    if not len(faces):
        return []
    objects = {name: number for number, name in enumerate(dict.fromkeys(each[0] for each in names))}
    of_object = np.array([objects[each[0]] for each in names])[row]
    parts = []
    for name, own in zip(objects, _members(of_object)):
        if len(own):
            part = part_of(name, points, faces[own])
            parts += split(part, [each[1:] for each in names], row[own])
    return parts


def gltf_parts(content: bytes, beside: ReadBeside, name: str) -> list[Part]:
    """The nodes with meshes of a glTF file, by materials where these are closed surfaces.

    Raises what `carillon.fem.geometry.gltf.plain_gltf` raises.
    """
    header, reader = opened_gltf(content, beside, name)
    meshes, materials = header.get("meshes", []), header.get("materials", [])
    parts: list[Part] = []
    for node, place in _placed(header):
        mesh = meshes[node["mesh"]]
        points, faces, labels, first = [], [], [], 0
        for number, primitive in enumerate(mesh["primitives"]):
            arrays = reader.arrays(primitive)
            if arrays is None:
                continue
            positions, corners, mode = arrays
            triangles = _strip(corners) if mode == STRIP else corners.reshape(-1, 3)
            points.append(positions.astype(float))
            faces.append(triangles + first)
            labels.append(np.full(len(triangles), number))
            first += len(positions)
        if not points:
            continue
        vertices = np.concatenate(points) @ place[:3, :3].T + place[:3, 3]
        own = str(node.get("name") or mesh.get("name") or "")
        names = [
            (str(materials[each["material"]].get("name", "")) if "material" in each else "",)
            for each in mesh["primitives"]
        ]
        part = Part(own, vertices, np.concatenate(faces).astype(np.int64))
        parts += split(part, names, np.concatenate(labels))
    return parts


def _strip(corners: Index) -> Index:
    """Triangles of a strip, every other one turned."""
    faces = np.stack([corners[:-2], corners[1:-1], corners[2:]], axis=1)
    faces[1::2] = faces[1::2, ::-1]
    return faces


def _placed(header: Header) -> Iterator[tuple[Header, Array]]:
    """Nodes with meshes of the scene that is shown, and their places (4, 4)."""
    nodes = header.get("nodes", [])
    scenes = header.get("scenes", [])
    if scenes:
        roots = scenes[header.get("scene", 0)].get("nodes", [])
    else:
        inner = {child for node in nodes for child in node.get("children", [])}
        roots = [number for number in range(len(nodes)) if number not in inner]
    below = [(number, np.eye(4)) for number in reversed(roots)]
    while below:
        number, place = below.pop()
        node = nodes[number]
        place = place @ _matrix(node)
        if "mesh" in node:
            yield node, place
        below += [(child, place) for child in reversed(node.get("children", []))]


def _matrix(node: Header) -> Array:
    if "matrix" in node:
        return np.array(node["matrix"], dtype=float).reshape(4, 4).T
    matrix = np.eye(4)
    x, y, z, w = node.get("rotation", (0.0, 0.0, 0.0, 1.0))
    turned = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrix[:3, :3] = turned * np.array(node.get("scale", (1.0, 1.0, 1.0)))
    matrix[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return matrix
