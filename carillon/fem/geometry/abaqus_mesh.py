"""Volume elements and their sets in input files of Abaqus and CalculiX (.inp)."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Index

KINDS = {
    "C3D4": "tetra",
    "C3D10": "tetra10",
    "C3D8": "hexahedron",
    "C3D20": "hexahedron20",
    "C3D27": "hexahedron27",
    "C3D6": "wedge",
    "C3D15": "wedge15",
    "C3D5": "pyramid",
}
"""Solid elements by Abaqus' names of them, without the letters that tell their integration."""
NODES = {"tetra": 4, "tetra10": 10, "hexahedron": 8, "hexahedron20": 20, "hexahedron27": 27}
NODES |= {"wedge": 6, "wedge15": 15, "pyramid": 5}
_KIND = re.compile(r"(C3D\d+)[A-Z]*$")
OTHERS = "others"
"""Name of the elements that are in no set."""


@dataclass
class AbaqusMesh:
    """Elements of one part."""

    points: Array
    """(p, 3)."""
    blocks: list[tuple[str, Index]]
    """Elements by kind, by the places of their nodes in `points`."""
    labels: NDArray[np.int64]
    """(c,) set of each element, 0 if none."""
    names: dict[int, str]
    """Names of the sets that have elements."""


@dataclass
class _Read:
    nodes: list[Array] = field(default_factory=list)
    elements: list[tuple[str, Index]] = field(default_factory=list)
    """Kinds, and numbers of elements beside those of their nodes."""
    sets: dict[str, list[Index]] = field(default_factory=dict)
    """Numbers of the elements of sets, by name in capitals."""
    spelt: dict[str, str] = field(default_factory=dict)
    """Names of sets as they are spelt."""
    sections: list[str] = field(default_factory=list)
    of_blocks: list[str] = field(default_factory=list)
    """Names of the sets of sections, and of those that *ELEMENT names."""


def read_abaqus(text: str) -> AbaqusMesh:
    """The volume elements of an input file, by the sets that tell their material.

    These are the sets of *SOLID SECTION; where there are none those of *ELSET, and after them those
    of *ELEMENT. An element in several is in the first.

    Raises ValueError if numbers are missing, nodes are not there, or there are several parts, whose
    places are told elsewhere.

    Examples
    --------
    >>> text = "*NODE\\n1,0,0,0\\n2,1,0,0\\n3,0,1,0\\n9,0,0,1\\n"
    >>> mesh = read_abaqus(text + "*ELEMENT, TYPE=C3D4, ELSET=all\\n1,1,2,3,9\\n")
    >>> mesh.blocks, mesh.names
    ([('tetra', array([[0, 1, 2, 3]]))], {1: 'all'})
    """
    read = _Read()
    parts = 0
    for keyword, parameters, lines in _sections(text):
        if keyword == "INCLUDE":
            raise ValueError("it includes other files, which are not read; write it as one")
        parts += keyword == "PART"
        if parts > 1:
            raise ValueError("it has several parts, expected one; write them without *PART")
        if keyword == "NODE":
            rows = [line.split(",")[:4] for line in lines]
            read.nodes.append(np.array(rows, dtype=float).reshape(-1, 4))
        elif keyword == "ELEMENT":
            _add_elements(read, parameters, lines)
        elif keyword == "ELSET":
            _add_set(read, parameters, lines)
        elif keyword == "SOLID SECTION" and "ELSET" in parameters:
            read.sections.append(parameters["ELSET"].upper())
    return _mesh(read)


def _sections(text: str) -> Iterator[tuple[str, dict[str, str], list[str]]]:
    keyword, parameters, lines = "", dict[str, str](), list[str]()
    for line in text.splitlines():
        if line.startswith("**") or not line.strip():
            continue
        if not line.startswith("*"):
            lines.append(line)
            continue
        if keyword:
            yield keyword, parameters, lines
        name, *rest = line[1:].split(",")
        pairs = [each.partition("=") for each in rest]
        keyword, lines = " ".join(name.upper().split()), []
        parameters = {key.strip().upper(): value.strip() for key, _, value in pairs}
    if keyword:
        yield keyword, parameters, lines


def _add_elements(read: _Read, parameters: dict[str, str], lines: list[str]) -> None:
    kind = _KIND.match(parameters.get("TYPE", "").upper())
    if kind is None or kind[1] not in KINDS:
        return
    name = KINDS[kind[1]]
    numbers = np.array([word for line in lines for word in line.split(",") if word.strip()], int)
    if len(numbers) % (NODES[name] + 1):
        raise ValueError(f"an element {kind[1]} does not have {NODES[name]} nodes")
    rows = numbers.reshape(-1, NODES[name] + 1)
    read.elements.append((name, rows))
    if "ELSET" in parameters:
        own = parameters["ELSET"]
        read.of_blocks.append(own.upper())
        read.spelt.setdefault(own.upper(), own)
        read.sets.setdefault(own.upper(), []).append(rows[:, 0])


def _add_set(read: _Read, parameters: dict[str, str], lines: list[str]) -> None:
    own = parameters.get("ELSET", "")
    read.spelt.setdefault(own.upper(), own)
    members = read.sets.setdefault(own.upper(), [])
    words = [word.strip() for line in lines for word in line.split(",") if word.strip()]
    if "GENERATE" in parameters:
        for line in lines:
            first, last, *step = (int(word) for word in line.split(",") if word.strip())
            members.append(np.arange(first, last + 1, step[0] if step else 1))
        return
    members.append(np.array([word for word in words if word.isdigit()], dtype=np.int64))
    for word in words:
        if not word.isdigit():
            members += read.sets.get(word.upper(), [])


def _mesh(read: _Read) -> AbaqusMesh:
    if not read.nodes:
        raise ValueError("it has no nodes")
    nodes = np.concatenate(read.nodes)
    numbers, first = np.unique(nodes[:, 0].astype(np.int64), return_index=True)
    blocks, element = [], [np.empty(0, dtype=np.int64)]
    for name, rows in read.elements:
        place = np.minimum(np.searchsorted(numbers, rows[:, 1:]), len(numbers) - 1)
        if (numbers[place] != rows[:, 1:]).any():
            raise ValueError(f"an element {name} names a node that is not there")
        blocks.append((name, place))
        element.append(rows[:, 0])
    every = np.concatenate(element)
    order = np.argsort(every, kind="stable")
    labels = np.zeros(len(every), dtype=np.int64)
    chosen = read.sections or [name for name in read.sets if name not in read.of_blocks]
    chosen = list(dict.fromkeys([*chosen, *([] if read.sections else read.of_blocks)]))
    for label, name in reversed(list(enumerate(chosen, 1))):
        members = np.concatenate([*read.sets.get(name, []), element[0]])
        there = np.searchsorted(every, members, sorter=order)
        there = order[np.minimum(there, max(len(every) - 1, 0))] if len(every) else members
        labels[there[every[there] == members]] = label
    names = {int(label): read.spelt[chosen[label - 1]] for label in np.unique(labels[labels > 0])}
    if names and (labels == 0).any():
        names[0] = OTHERS
    return AbaqusMesh(nodes[first, 1:], blocks, labels, names)
