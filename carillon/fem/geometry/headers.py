"""STL and PLY files of which less is read than they hold, or hold less than they say."""

from __future__ import annotations

import re

from carillon.errors import UserError

STL_HEADER, STL_TRIANGLE = 84, 50
"""Bytes of a binary STL file before its triangles, and of each."""
_STRIPS = re.compile(rb"^element\s+(tristrips?)\s+(\d+)", re.MULTILINE)
_ELEMENT = re.compile(rb"^element\s+(\S+)\s+(\d+)", re.MULTILINE)
_END = re.compile(rb"^end_header[^\n]*\n", re.MULTILINE)


def require_whole_stl(content: bytes, path: str) -> None:
    """Refuse STL files that end before they are complete.

    Raises
    ------
    UserError
        If there are fewer triangles than the header of a binary file says, or a text file ends
        within a solid.

    Examples
    --------
    >>> require_whole_stl(bytes(80) + b"\\x02\\0\\0\\0" + bytes(50), "half.stl")
    Traceback (most recent call last):
    carillon.errors.UserError: half.stl: is shorter than its header says, 1 of 2 triangles; ...
    """
    if content.lstrip()[:5].lower() == b"solid" and b"facet" in content[:1000].lower():
        if b"endsolid" not in content[-1000:].lower():
            raise UserError(
                f"{path}: ends within a solid, after {content.lower().count(b'endfacet'):,} "
                "triangles; export or copy it again"
            )
        return
    count = int.from_bytes(content[STL_HEADER - 4 : STL_HEADER], "little")
    _require_as_many(max(len(content) - STL_HEADER, 0) // STL_TRIANGLE, count, "triangles", path)


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
