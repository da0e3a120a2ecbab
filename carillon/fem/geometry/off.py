"""OFF files with faces of different numbers of corners, which trimesh does not read."""

from __future__ import annotations

import re

_COMMENT = re.compile(r"#[^\n]*")


def obj_of_off(content: bytes) -> bytes | None:
    r"""The content of an OFF file as OBJ; None if its faces have as many corners each.

    Raises
    ------
    ValueError, IndexError
        If the file ends early, has something else in the place of a number, or a face names a
        negative vertex.

    Examples
    --------
    >>> obj_of_off(b"OFF\n4 2 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 1 2\n4 0 1 2 3\n")
    b'v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 3 4\n'
    """
    lines = [line.split() for line in _COMMENT.sub("", content.decode()).splitlines()]
    lines = [line for line in lines if line]
    if not lines or lines[0][0] != "OFF":
        return None
    counts, rest = (lines[0][1:], lines[1:]) if len(lines[0]) > 1 else (lines[1], lines[2:])
    vertices, faces = int(counts[0]), int(counts[1])
    corners = [rest[vertices + face] for face in range(faces)]
    if len({line[0] for line in corners}) == 1:
        return None
    text = [f"v {' '.join(line[:3])}" for line in rest[:vertices]]
    for line in corners:
        numbers = [int(word) + 1 for word in line[1 : 1 + int(line[0])]]
        if len(numbers) < int(line[0]):
            raise ValueError(f"a face of {line[0]} corners has {len(numbers)}")
        if min(numbers, default=1) < 1:
            raise ValueError(f"a face names vertex {min(numbers) - 1}")
        text.append(f"f {' '.join(map(str, numbers))}")
    return "\n".join([*text, ""]).encode()
