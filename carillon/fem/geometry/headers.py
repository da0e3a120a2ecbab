"""STL and PLY files of which less is read than they hold, or hold less than they say."""

from __future__ import annotations

import codecs
import re

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


def whole_stl(content: bytes, path: str) -> bytes:
    r"""The content of an STL file in the form that trimesh reads.

    Lines of a text end with a line feed, and a few bytes after a binary file's triangles are left
    out.

    Raises
    ------
    UserError
        If there are fewer triangles than the header of a binary file says, or more, or a text file
        ends within a solid.

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

    Raises
    ------
    UserError
        If there are strips, which are not read, or fewer rows than the header says.

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
    for found in _ELEMENT.finditer(header):
        count = int(found[2])
        if found[1] == b"face" and rows == count > 0 and not content.endswith((b"\n", b"\r")):
            last = lines[-1].split()
            rows -= last[0].isdigit() and len(last) <= int(last[0])
        if rows < count:
            name = {b"vertex": "vertices", b"face": "faces"}.get(found[1], "rows")
            _require_as_many(rows, count, name, path)
        rows -= count


def _require_as_many(found: int, count: int, things: str, path: str) -> None:
    if found < count:
        raise UserError(
            f"{path}: is shorter than its header says, {found:,} of {count:,} {things}; export or "
            "copy it again"
        )
