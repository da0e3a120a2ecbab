"""OBJ, OFF, STL and PLY files in the plain form that trimesh reads rightly.

Legal, but not read as what they say: in OBJ, indices that count back from the vertices so far,
lines that go on after a backslash, comments behind numbers, tabs and spaces before or after a
keyword; in OFF, faces of different numbers of corners. Of STL and PLY less is read than they hold,
or they hold less than they say.
"""

import codecs
import re
from collections.abc import Iterator

from carillon.errors import UserError

STL_HEADER, STL_TRIANGLE = 84, 50
"""Bytes of a binary STL file before its triangles, and bytes of one triangle."""
TEXT_START = 4000
"""Bytes at the start of a text file that are checked: none is zero, and the first triangle is among
them."""
_FACET = re.compile(rb"^\s*facet\b", re.MULTILINE)
_STRIPS = re.compile(rb"^element\s+(tristrips?)\s+(\d+)", re.MULTILINE)
_ELEMENT = re.compile(rb"^element\s+(\S+)\s+(\d+)", re.MULTILINE)
_END = re.compile(rb"^end_header[^\n]*\n", re.MULTILINE)
_COMMENT = re.compile(r"#[^\n]*")
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

    Raises ValueError if a vertex does not have three coordinates, or a face names one that is not
    there.

    Examples
    --------
    >>> plain_obj(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3/-1 -2 \\\n -1 # all\n")
    b'v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n'
    """
    if not _UNUSUAL.search(content):
        return content
    vertices: list[str] = []
    faces: list[str] = []
    for keyword, words in obj_lines(content):
        if keyword == "v":
            if len(words) < 3:
                raise ValueError("a vertex does not have three coordinates")
            vertices.append(f"v {' '.join(words[:3])}\n")
        elif keyword == "f":
            corners = [vertex_number(word, len(vertices)) for word in words]
            fan = zip(corners[1:], corners[2:])
            faces += [f"f {corners[0]} {second} {third}\n" for second, third in fan]
    return "".join([*vertices, *faces]).encode("latin-1")


def obj_lines(content: bytes) -> Iterator[tuple[str, list[str]]]:
    """Keyword and words of each line of an OBJ file, in which a byte is a character (Latin-1)."""
    for line in _ENDS.split(_GOES_ON.sub(" ", content.decode("latin-1"))):
        keyword, *words = line.partition("#")[0].split() or [""]
        yield keyword, words


def vertex_number(word: str, count: int) -> int:
    """Number, from 1, of the vertex that a face's "v/vt/vn" names after `count` of them."""
    index = int(word.partition("/")[0])
    if index == 0 or index < -count:
        raise ValueError(f"a face names vertex {index} where there are {count}")
    # Faces may come before their vertices, unless they count back.
    return index if index > 0 else count + 1 + index


def obj_of_off(content: bytes) -> bytes | None:
    r"""The content of an OFF file as OBJ; None if its faces have as many corners each.

    Raises ValueError, IndexError if the file ends early, has something else in the place of a
    number, or a face names a negative vertex.

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


def whole_stl(content: bytes, path: str) -> bytes:
    r"""The content of an STL file in the form that trimesh reads.

    Lines of a text end with a line feed, and a few bytes after a binary file's triangles are left
    out. Raises UserError if there are fewer triangles than the header of a binary file says, or
    more, or a text file ends within a solid.

    Examples
    --------
    >>> whole_stl(bytes(80) + b"\x02\0\0\0" + bytes(50), "half.stl")
    Traceback (most recent call last):
    carillon.errors.UserError: half.stl: is shorter than its header says, 1 of 2 triangles; ...
    """
    start = content[:TEXT_START].lower()
    if b"\0" not in start and b"facet" in start:
        return _whole_text(content.removeprefix(codecs.BOM_UTF8), path)
    count = int.from_bytes(content[STL_HEADER - 4 : STL_HEADER], "little")
    there = max(len(content) - STL_HEADER, 0) // STL_TRIANGLE
    _require_as_many(there, count, "triangles", path)
    if there > count:
        raise UserError(
            f"{path}: its header says {count:,} triangles, and there is room for {there:,}; export "
            "it again"
        )
    return content[: STL_HEADER + STL_TRIANGLE * count]


def _whole_text(content: bytes, path: str) -> bytes:
    text = re.sub(rb"\r\n?", b"\n", content)
    text = re.sub(rb"\bend\s+solid\b", b"endsolid", text, flags=re.IGNORECASE)
    lower = text.lower()
    after = lower[lower.rfind(b"endfacet") :].removeprefix(b"endfacet")
    if b"endsolid" not in after or _FACET.search(after):
        raise UserError(
            f"{path}: ends within a solid, after {lower.count(b'endfacet'):,} triangles; export or "
            "copy it again"
        )
    return text


def require_plain_ply(content: bytes, path: str) -> None:
    """Refuse PLY files of triangle strips, and text files that end before they are complete.

    Raises UserError if there are strips, which are not read, or fewer rows than the header says.

    Examples
    --------
    >>> header = b"ply\\nformat ascii 1.0\\nelement vertex 4\\nelement face 4\\nend_header\\n"
    >>> require_plain_ply(header + b"0 0 0\\n" * 4 + b"3 0 1 2\\n" * 3, "short.ply")
    Traceback (most recent call last):
    carillon.errors.UserError: short.ply: is shorter than its header says, 3 of 4 faces; ...
    """
    end = _END.search(content)
    if end is None:
        return
    header = content[: end.start()].replace(b"\r", b"\n")
    strips = _STRIPS.search(header)
    if strips and int(strips[2]):
        raise UserError(
            f"{path}: its faces are triangle strips, which are not read; export triangles"
        )
    if not re.search(rb"^format\s+ascii", header, re.MULTILINE):
        return
    lines = [line for line in content[end.end() :].splitlines() if line.strip()]
    rows = len(lines)
    for element in _ELEMENT.finditer(header):
        count = int(element[2])
        if element[1] == b"face" and rows == count > 0 and not content.endswith((b"\n", b"\r")):
            last = lines[-1].split()
            rows -= last[0].isdigit() and len(last) <= int(last[0])
        if rows < count:
            name = {b"vertex": "vertices", b"face": "faces"}.get(element[1], "rows")
            _require_as_many(rows, count, name, path)
        rows -= count


def _require_as_many(there: int, count: int, things: str, path: str) -> None:
    if there < count:
        raise UserError(
            f"{path}: is shorter than its header says, {there:,} of {count:,} {things}; export or "
            "copy it again"
        )
