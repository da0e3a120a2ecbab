"""OBJ files in the plain form that trimesh reads rightly.

Legal, but not read as what they say: indices that count back from the vertices so far, lines that
go on after a backslash, comments behind numbers, tabs and spaces before or after a keyword.
"""

from __future__ import annotations

import re

_UNUSUAL = re.compile(
    rb"""
      \\\r?$                            # a line that goes on
    | \r(?!\n)                          # lines that end with carriage returns alone
    | ^[ \t]+[vf][ \t]                  # indented
    | ^[vf]\t
    | ^[vf][ ][^\n]*\#                  # a comment
    | ^f[ ][^\n]*[- /]0*-               # an index that counts back
    | ^f[ ](?:[^\n]*[ \t])?0+(?![0-9])  # an index that there is not
    """,
    re.MULTILINE | re.VERBOSE,
)
_ENDS = re.compile(r"\r\n|\r|\n")
_GOES_ON = re.compile(r"\\(?:\r\n|\r|\n)")


def plain_obj(content: bytes) -> bytes:
    r"""The content of an OBJ file, if need be with its vertices and triangles alone.

    Raises
    ------
    ValueError
        If a vertex does not have three coordinates, or a face names one that is not there.

    Examples
    --------
    >>> plain_obj(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3/-1 -2 \\\n -1 # all\n")
    b'v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n'
    """
    if not _UNUSUAL.search(content):
        return content
    vertices: list[str] = []
    faces: list[str] = []
    for line in _ENDS.split(_GOES_ON.sub(" ", content.decode("latin-1"))):
        keyword, *words = line.partition("#")[0].split() or [""]
        if keyword == "v":
            if len(words) < 3:
                raise ValueError("a vertex does not have three coordinates")
            vertices.append(f"v {' '.join(words[:3])}\n")
        elif keyword == "f":
            corners = [_number(word, len(vertices)) for word in words]
            fan = zip(corners[1:], corners[2:])
            faces += [f"f {corners[0]} {second} {third}\n" for second, third in fan]
    return "".join([*vertices, *faces]).encode("latin-1")


def _number(word: str, count: int) -> int:
    """Number, from 1, of the vertex that a corner "v/vt/vn" of a face names after `count` of them.

    Faces may come before their vertices, unless they count back.
    """
    index = int(word.partition("/")[0])
    if index == 0 or index < -count:
        raise ValueError(f"a face names vertex {index} where there are {count}")
    return index if index > 0 else count + 1 + index
