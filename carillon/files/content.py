"""Check of an HDF5 file before it is read: its content is all there, and no more than the file.

A few kilobytes of HDF5 can stand for any number of bytes: one group under many names, chunks that
are compressed or far larger than their dataset, many texts that are one.
"""

import math
from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from h5py import h5a, h5o, h5z

from carillon.files.datasets import refused

MOST_OBJECTS, DEEPEST = 100_000, 16
"""Groups and datasets of a file, and groups inside each other; files have dozens, four deep."""
MOST_ATTRIBUTES = 1024
"""Attributes that a group or dataset may have."""
LIST_BYTES = 1 << 28
"""Most bytes of a list of texts in an attribute, as far as can be told before it is read."""

_SAME_LENGTH = {h5z.FILTER_FLETCHER32, h5z.FILTER_SHUFFLE}
"""Filters whose output is as long as what is stored, but for a checksum."""
_TEXT = np.dtype([("length", "<u4"), ("address", "<u8"), ("index", "<u4")])
"""Reference to a text of any length in a dataset; the text itself is in a heap."""
_HEAP, _HEAP_HEAD = b"GCOL\1\0\0\0", 16
"""First bytes of a heap of texts, and how many tell its length, the last eight of them."""
_PIECE = 1 << 20


def require_whole(file: h5py.File) -> None:
    """Check that what a file holds lies in it, where a checksum covers it, is all there, and once.

    Then nothing that is read of it takes more memory than the file has bytes, but for a factor that
    is known; of the numbers nothing is read here. Raises UserError if there is a link other than
    the one name of its own content, or a dataset whose numbers are those of other files, were never
    written, are compressed, or take more room than the file has; or if texts are references, or
    together longer than the file.
    """
    size = file.id.get_filesize()
    longest = cache(partial(_longest_heap, Path(file.filename)))
    numbers = texts = 0
    for group, name, entry in _entries(file["/"]):
        texts += _texts_beside(group, entry, size, longest)
        if texts <= size and isinstance(entry, h5py.Dataset):
            _require_numbers_here(group, name, entry, size)
            numbers += max(_bytes_of(entry), entry.id.get_storage_size())
            texts += _texts_in(group, name, entry)
        if max(numbers, texts) > size:
            raise refused(
                group,
                f"its datasets and texts up to {name!r} take {max(numbers, texts):,} bytes, the "
                f"whole file has {size:,}",
            )


def _entries(root: h5py.Group) -> Iterator[tuple[h5py.Group, str, Any]]:
    """Each group and dataset once, with the group that it is in and its name there.

    Raises UserError if there are too many, they are too deep, or one has two names.
    """
    yield root, "/", root
    seen = {h5o.get_info(root.id).addr}
    open_groups = [(root, 1)]
    while open_groups:
        group, depth = open_groups.pop()
        if len(seen) + len(group) > MOST_OBJECTS:
            raise refused(group, f"holds more than {MOST_OBJECTS:,} groups and datasets")
        for name in group:
            if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                raise refused(group, f"holds a link, {name!r}, expected what it names")
            entry = group[name]
            address = h5o.get_info(entry.id).addr
            if address in seen:
                raise refused(group, f"holds a link, {name!r}, to what has another name too")
            seen.add(address)
            yield group, name, entry
            if isinstance(entry, h5py.Group):
                if depth == DEEPEST:
                    raise refused(group, f"has groups more than {DEEPEST} deep")
                open_groups.append((entry, depth + 1))


def _require_numbers_here(group: h5py.Group, name: str, dataset: h5py.Dataset, size: int) -> None:
    if dataset.is_virtual or dataset.external:
        raise refused(group, f"dataset {name!r} takes its numbers from another file")
    made = dataset.id.get_create_plist()
    if {made.get_filter(n)[0] for n in range(made.get_nfilters())} - _SAME_LENGTH:
        raise refused(group, f"dataset {name!r} is compressed, expected plain numbers")
    if dataset.id.get_storage_size() < _bytes_of(dataset):
        raise refused(group, f"dataset {name!r} is incomplete")
    chunk = math.prod(dataset.chunks or ()) * dataset.dtype.itemsize
    longest = max(dataset.shape or (0,))
    if max(chunk, longest) > size:
        raise refused(
            group,
            f"dataset {name!r} of shape {dataset.shape} is stored in pieces of {chunk:,} bytes, "
            f"the whole file has {size:,}",
        )


def _bytes_of(dataset: h5py.Dataset) -> int:
    return _count(dataset.shape) * int(dataset.dtype.itemsize)


def _count(shape: tuple[int, ...] | None) -> int:
    """Values of a shape, whose number may be beyond 64 bits; none of one that is empty."""
    return 0 if shape is None else math.prod(map(int, shape))


def _texts_in(group: h5py.Group, name: str, dataset: h5py.Dataset) -> int:
    """Bytes that a dataset's texts of any length will take, of which none is read."""
    if not _is_text(group, name, dataset.dtype):
        return 0
    place, count = dataset.id.get_offset(), _count(dataset.shape)
    if not count:
        return 0
    if place is None or dataset.id.get_storage_size() != count * _TEXT.itemsize:
        raise refused(group, f"dataset {name!r} holds texts in pieces, expected them in a row")
    stored = np.fromfile(group.file.filename, _TEXT, count, offset=place)
    return int(stored["length"].sum(dtype=np.int64))


def _texts_beside(group: h5py.Group, entry: Any, size: int, longest: Callable[[], int]) -> int:
    """Bytes of texts of any length in the attributes of a group or dataset."""
    if h5a.get_num_attrs(entry.id) > MOST_ATTRIBUTES:
        raise refused(group, f"has something of more than {MOST_ATTRIBUTES:,} attributes")
    total = 0
    names: list[bytes] = []
    h5a.iterate(entry.id, names.append)
    for name in names:
        attribute = h5a.open(entry.id, name)
        shape, dtype = attribute.shape, attribute.dtype
        if _count(shape) * dtype.itemsize > size:
            return size + 1
        if not _is_text(group, name.decode(errors="replace"), dtype):
            continue
        if shape and _count(shape) * size > LIST_BYTES:  # it cannot be read text by text
            most = _count(shape) * longest()
            if most > max(size, LIST_BYTES):
                return most
        values = np.empty(shape, dtype)
        attribute.read(values)
        total += sum(len(value) for value in values.flat if value)
        if total > size:
            break
    return total


def _is_text(group: h5py.Group, name: str, dtype: np.dtype[Any]) -> bool:
    """Whether values are texts of any length; what else has no fixed length is refused."""
    if not dtype.hasobject:
        return False
    if dtype.kind != "O" or h5py.check_string_dtype(dtype) is None:
        raise refused(group, f"{name!r} holds references or lists, expected numbers or texts")
    return True


def _longest_heap(path: Path) -> int:
    """Bytes of the longest heap of texts in a file; no text is longer than its heap."""
    longest, before, size = 0, b"", path.stat().st_size
    with open(path, "rb") as stream:
        while piece := stream.read(_PIECE):
            content = before + piece
            at = content.find(_HEAP)
            while 0 <= at <= len(content) - _HEAP_HEAD:
                length = int.from_bytes(content[at + 8 : at + _HEAP_HEAD], "little")
                longest = max(longest, length if length <= size else 0)
                at = content.find(_HEAP, at + 1)
            before = content[1 - _HEAP_HEAD :]
    return longest
