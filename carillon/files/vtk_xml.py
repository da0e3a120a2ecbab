"""Arrays in VTK's XML files (.vtu, .vti): as text, in base64 or raw, compressed by zlib or not.

What an array may take is known from the numbers of points and cells before it is decoded, and no
more is decoded than that, since a few compressed bytes can stand for any number.
"""

from __future__ import annotations

import base64
import math
import re
import zlib
from dataclasses import dataclass
from functools import cached_property
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from carillon.files.vtu import TYPES

DTYPES = {name: dtype for dtype, name in TYPES.items()}
"""Numbers by VTK's names of them."""
ZLIB = "vtkZLibDataCompressor"
LONGEST = 2 << 30
"""Bytes that the arrays of a file may take."""
SMALL, GROWTH = 1 << 27, 64
"""Bytes that the arrays of any file may take, and how often its own length those of a longer one:
labels, which are nearly all alike, shrink the most."""
_APPENDED = re.compile(rb"<AppendedData[^>]*>")
_WHITE = re.compile(rb"\s+")


@dataclass(frozen=True)
class VtkFile:
    """A file of one piece, whose arrays are decoded when they are asked for.

    Everything raises ValueError, KeyError, zlib.error or ElementTree.ParseError if the file is none
    of the kind, or damaged.
    """

    root: ElementTree.Element
    grid: ElementTree.Element
    """The element of the grid, which is named after its type."""
    length: int
    """Bytes of the file."""
    appended: bytes
    """What follows the underscore of appended data."""
    is_raw: bool

    @classmethod
    def of_content(cls, content: bytes, kind: str) -> VtkFile:
        """The file with these bytes, whose type is `kind` ("UnstructuredGrid", "ImageData")."""
        if b"<!DOCTYPE" in content[:4096] or b"<!ENTITY" in content[:65536]:
            raise ValueError("it defines entities, which no grid needs")
        tag = _APPENDED.search(content)
        head, appended, is_raw = content, b"", False
        if tag is not None:
            is_raw = b"raw" in tag.group()
            begin = content.index(b"_", tag.end()) + 1
            end = len(content) if is_raw else content.index(b"<", begin)
            appended = content[begin:end]
            head = content[: tag.start()] + b"</VTKFile>"
        root = ElementTree.fromstring(head)
        if root.tag != "VTKFile" or root.get("type") != kind:
            raise ValueError(f"found {root.get('type')!s:.40} in <{root.tag:.40}>, expected {kind}")
        if root.get("compressor", ZLIB) != ZLIB:
            raise ValueError(
                f"it is compressed by {root.get('compressor'):.40}, expected {ZLIB} or nothing"
            )
        grid = root.find(kind)
        if grid is None:
            raise ValueError(f"it has no {kind}")
        return cls(root, grid, len(content), appended, is_raw)

    @cached_property
    def piece(self) -> ElementTree.Element:
        """The one piece."""
        pieces = self.grid.findall("Piece")
        if len(pieces) != 1:
            raise ValueError(f"it has {len(pieces)} pieces, expected one; merge them")
        return pieces[0]

    def number(self, name: str) -> int:
        """A count that the piece says, as `NumberOfCells`."""
        count = int(self.piece.attrib[name])
        if count < 0:
            raise ValueError(f"{name} is {count}")
        return count

    def sections(self, section: str) -> dict[str, ElementTree.Element]:
        """The arrays of a section of the piece, as `CellData`, by name."""
        found = self.piece.find(section)
        arrays = [] if found is None else found.findall("DataArray")
        return {each.get("Name", ""): each for each in arrays}

    def array(self, tag: ElementTree.Element, rows: int) -> NDArray[Any]:
        """An array, (rows,) or (rows, components)."""
        if tag.get("type") not in DTYPES:
            raise ValueError(f"array {tag.get('Name', '')!r:.60} is of {tag.get('type')!s:.20}")
        components = int(tag.get("NumberOfComponents", "1"))
        dtype = DTYPES[tag.attrib["type"]]
        shape = (rows, components) if components > 1 else (rows,)
        size = dtype.itemsize * math.prod(shape)
        if not 0 <= size <= min(LONGEST, SMALL + GROWTH * self.length):
            raise ValueError(
                f"array {tag.get('Name', '')!r:.60} would take {size:,} bytes in a file of "
                f"{self.length:,}"
            )
        form = tag.get("format", "ascii")
        if form == "ascii":
            values = _from_text(tag.text or "", dtype, math.prod(shape))
        elif form in ("binary", "appended"):
            inline = form == "binary"
            if inline:
                encoded = memoryview(_WHITE.sub(b"", (tag.text or "").encode()))
            else:
                encoded = memoryview(self.appended)[int(tag.attrib["offset"]) :]
            raw = self.is_raw and not inline
            values = np.frombuffer(self._decoded(encoded, raw, size), self._order(dtype))
        else:
            raise ValueError(f"an array is in {form:.40}, expected ascii, binary or appended")
        if values.size != math.prod(shape):
            raise ValueError(
                f"array {tag.get('Name', '')!r:.60} has {values.size:,} numbers, expected "
                f"{math.prod(shape):,}"
            )
        return values.astype(dtype, copy=False).reshape(shape)

    def _order(self, dtype: np.dtype[Any]) -> np.dtype[Any]:
        little = self.root.get("byte_order", "LittleEndian") == "LittleEndian"
        return dtype.newbyteorder("<" if little else ">")

    def _decoded(self, encoded: memoryview, raw: bool, size: int) -> bytes:
        """The `size` bytes of an array; fewer if there are no more."""
        count = self._order(DTYPES[self.root.get("header_type", "UInt32")])

        def take(first: int, length: int) -> bytes:
            """Bytes of what base64 encodes as one."""
            if raw:
                return bytes(encoded[first : first + length])
            start, stop = first // 3 * 4, -(-(first + length) // 3) * 4
            return base64.b64decode(encoded[start:stop])[first % 3 :][:length]

        width = count.itemsize
        if self.root.get("compressor") is None:
            (length,) = np.frombuffer(take(0, width), count)
            if int(length) > size:
                raise ValueError(f"an array has {length:,} bytes, expected {size:,}")
            return take(width, int(length))
        blocks, block, last = (int(each) for each in np.frombuffer(take(0, 3 * width), count))
        if blocks > len(encoded) or blocks * block > size + block:
            raise ValueError(f"an array has {blocks:,} blocks of {block:,} bytes, not {size:,}")
        lengths = np.frombuffer(take(3 * width, blocks * width), count).astype(np.int64)
        begin = (3 + blocks) * width
        if not raw:  # The numbers of bytes are encoded by themselves.
            encoded = encoded[-(-begin // 3) * 4 :]
            begin = 0
        parts, ends = [], begin + np.cumsum(lengths)
        for number, (length, end) in enumerate(zip(lengths.tolist(), ends.tolist(), strict=True)):
            full = last if last and number == blocks - 1 else block
            part = zlib.decompressobj().decompress(take(end - length, length), max(full, 1))
            if len(part) != full:
                raise ValueError(f"a block has {len(part):,} bytes, expected {full:,}")
            parts.append(part)
        return b"".join(parts)


def _from_text(text: str, dtype: np.dtype[Any], count: int) -> NDArray[Any]:
    words = text.split(None, count)
    if len(words) != count:
        raise ValueError(f"an array has {len(words):,} numbers, expected {count:,}")
    return np.array(words, dtype=dtype) if count else np.empty(0, dtype=dtype)
