"""The ZIP file of a crate: every file is read once, for its copy, length and SHA-256."""

import hashlib
import time
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from carillon.command_line.progress import track
from carillon.errors import UserError
from carillon.files.atomic import atomic_path
from carillon.files.paths import cause
from workflow.crate.contents import CrateFile

DENSE = (".h5", ".png", ".jpg", ".webp", ".zip", ".mp4")
"""Endings of files that do not become smaller."""
EARLIEST, LATEST = (1980, 1, 1, 0, 0, 0), (2107, 12, 31, 23, 59, 58)
"""First and last of the dates that ZIP files know."""
_PIECE = 1 << 20


@dataclass(frozen=True)
class Copied:
    """A file as it is in a crate."""

    file: CrateFile
    size: int
    """Bytes."""
    sha256: str
    modified: float
    """Time of its last change [s since 1970]."""


def write_archive(
    path: Path,
    files: Sequence[CrateFile],
    describe: Callable[[Sequence[Copied]], Mapping[str, str]],
) -> list[Copied]:
    """Write a ZIP file of files and of texts about them; returns the files.

    `describe` makes the texts, by their names, from the files as they were copied.

    Equal files, with equal times, make equal bytes. The archive is whole or absent. Raises
    UserError if a file cannot be read or the archive not written.
    """
    total = sum(map(_size, files))
    copied: list[Copied] = []
    with atomic_path(path) as temporary, zipfile.ZipFile(temporary, "w") as archive:
        for each in track(_copies(archive, files), "crate", total, "B", weight=lambda c: c.size):
            copied.append(each)
        last = max(each.modified for each in copied)
        for name, text in describe(copied).items():
            _add(archive, _entry(name, last), iter([text.encode()]))
    return copied


@contextmanager
def _reading(path: Path) -> Iterator[None]:
    """Tell errors of a file that is read from those of the archive, which is written meanwhile."""
    try:
        yield
    except OSError as error:
        raise UserError(f"{path}: cannot be copied ({cause(error)})") from error


def _size(file: CrateFile) -> int:
    with _reading(file.path):
        return file.path.stat().st_size


def _copies(archive: zipfile.ZipFile, files: Sequence[CrateFile]) -> Iterator[Copied]:
    for file in files:
        with _reading(file.path):
            modified = file.path.stat().st_mtime
        size, sha256 = _add(archive, _entry(file.name, modified), _pieces(file.path))
        yield Copied(file, size, sha256, modified)


def _pieces(path: Path) -> Iterator[bytes]:
    with _reading(path):
        stream = open(path, "rb")
    with stream:
        while True:
            with _reading(path):
                piece = stream.read(_PIECE)
            if not piece:
                return
            yield piece


def _entry(name: str, modified: float) -> zipfile.ZipInfo:
    moment = min(max(EARLIEST, time.gmtime(modified)[:6]), LATEST)
    entry = zipfile.ZipInfo(name, moment)
    entry.external_attr = 0o644 << 16
    dense = name.endswith(DENSE)
    entry.compress_type = zipfile.ZIP_STORED if dense else zipfile.ZIP_DEFLATED
    return entry


def _add(
    archive: zipfile.ZipFile, entry: zipfile.ZipInfo, pieces: Iterator[bytes]
) -> tuple[int, str]:
    """Add a file; returns its bytes and their SHA-256."""
    checksum, size = hashlib.sha256(), 0
    with archive.open(entry, "w", force_zip64=True) as target:
        for piece in pieces:
            target.write(piece)
            checksum.update(piece)
            size += len(piece)
    return size, checksum.hexdigest()
