"""HDF5 files that are complete or absent, checked when they are opened."""

import hashlib
import io
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

import h5py

from carillon.errors import ConvergenceError, UserError
from carillon.files.atomic import atomic_path
from carillon.files.content import require_whole
from carillon.files.paths import cause, first_line, require_file

LONGEST_KIND = 40
"""Longest kind of a file in characters, in messages."""

SEAL_BYTES = 512
"""Length of the seal, which stands before the HDF5 file proper (its user block)."""

_FAULTS = {OSError: "damaged", KeyError: "incomplete", Exception: "not what it should be"}
_NONSENSE = (
    OSError,
    LookupError,
    ValueError,
    TypeError,
    AttributeError,
    ArithmeticError,
    RuntimeError,
)
"""Exceptions of HDF5, numpy and JSON on a file that holds something else than is read from it."""
_SEAL = b"Carillon: the bytes behind the first 512 have the SHA-256 "
_UNSEALED = "is damaged (its checksum is gone); remove it and generate the file again"
_HDF5 = b"\x89HDF\r\n\x1a\n"
"""First bytes of what HDF5 reads, which follows on a seal."""


class _Disk(io.FileIO):
    """A file for HDF5 that never fails: the first error is kept for later, what follows is dropped.

    HDF5 itself crashes once it could not write what it holds, for instance on a full disk, or when
    it then reads beyond the end of its file: what is dropped becomes a hole, which takes no room.
    """

    failure: OSError | None = None

    def write(self, data: Any) -> int:
        """Write all of `data`, or remember why that failed."""
        view = memoryview(data).cast("B")
        begin, done = self.tell(), 0
        while done < len(view) and self.failure is None:
            try:
                done += super().write(view[done:]) or 0
            except OSError as error:
                self.failure = error
        if done < len(view):
            self._leave_hole(begin + len(view))
        return len(view)

    def _leave_hole(self, end: int) -> None:
        with suppress(OSError):
            if end > os.fstat(self.fileno()).st_size:
                super().truncate(end)
        self.seek(end)

    def readinto(self, buffer: Any) -> int:
        """Read, zeros where a hole could not be left."""
        view = memoryview(buffer).cast("B")
        begin = self.tell()
        done = super().readinto(view) or 0
        if self.failure is not None and done < len(view):
            view[done:] = bytes(len(view) - done)
            done = len(view)
            self.seek(begin + done)
        return done

    def truncate(self, size: int | None = None) -> int:
        """Set the length, or remember why that failed."""
        try:
            return super().truncate(size)
        except OSError as error:
            self.failure = self.failure or error
            return size or 0

    def check(self) -> None:
        """Raise the first error."""
        if self.failure is not None:
            raise self.failure


@contextmanager
def create_h5(
    path: str | Path, kind: str, schema: int, sealed: bool = False
) -> Iterator[h5py.File]:
    """Create the HDF5 file `path` atomically, marked with its kind and schema version.

    A sealed one begins with a checksum of all other bytes, which `open_h5` verifies.
    """
    with atomic_path(path) as temporary:
        with _Disk(temporary, "w+b") as disk:
            try:
                with h5py.File(disk, "w", userblock_size=SEAL_BYTES if sealed else 0) as file:
                    file.attrs["kind"] = kind
                    file.attrs["schema_version"] = schema
                    yield file
            except UserError:  # from whoever makes the contents, and knows more
                raise
            except BaseException:
                disk.check()  # it says more than what HDF5 then stumbles over
                raise
            disk.check()
        if sealed:
            with open(temporary, "rb+") as stream:
                stream.write(_seal_of(stream))


def _seal_of(stream: io.BufferedRandom | io.BufferedReader) -> bytes:
    """The seal that `stream` should begin with; leaves the position at the beginning."""
    digest = hashlib.sha256()
    stream.seek(SEAL_BYTES)
    while piece := stream.read(1 << 20):
        digest.update(piece)
    stream.seek(0)
    return (_SEAL + digest.hexdigest().encode() + b"\n").ljust(SEAL_BYTES, b"\0")


def _begins_with_seal(path: Path) -> bool:
    with open(path, "rb") as stream:
        return stream.read(len(_SEAL)) == _SEAL


def _is_sealed(path: Path) -> bool:
    """Whether the file begins with a seal; it is read once in a process, unless it changes.

    Raises UserError if the seal is broken.
    """
    status = path.stat()
    return _is_version_sealed(path, status.st_ino, status.st_size, status.st_mtime_ns)


@cache
def _is_version_sealed(path: Path, inode: int, size: int, changed: int) -> bool:
    with open(path, "rb") as stream:
        seal = stream.read(SEAL_BYTES)
        if not seal.startswith(_SEAL):
            if stream.read(len(_HDF5)) == _HDF5:
                # HDF5 may crash on bytes that nothing vouches for.
                raise UserError(f"{path}: {_UNSEALED}")
            return False
        if seal != _seal_of(stream):
            raise UserError(
                f"{path}: is damaged (its bytes do not match their checksum); remove it and "
                "generate the file again"
            )
    return True


@contextmanager
def open_h5(
    path: str | Path, kind: str, schema: int, sealed: bool = False, checked: bool = False
) -> Iterator[h5py.File]:
    """Open the HDF5 file `path` for reading and check that it is what it should be.

    A seal is verified if there is one, before HDF5 sees the file; `sealed` demands one. With
    `checked` its bytes are taken for checked, by whoever shares the work on large files. What goes
    wrong within the body is taken for a fault of the file: do nothing but reading in there. Raises
    UserError if the file is missing, damaged, of another kind, or of another schema version, or its
    content cannot be read as the body tries to.
    """
    path = require_file(path, f"a Carillon {kind} file (HDF5)")
    try:
        found_seal = _begins_with_seal(path) if checked else _is_sealed(path)
        file = opened_h5(path)
    except OSError as error:
        if error.errno:  # the system's refusal, which says nothing of what the file holds
            raise UserError(
                f"{path}: cannot be read ({cause(error)}), expected a Carillon {kind} file"
            ) from None
        raise UserError(
            f"{path}: is not readable as HDF5 ({first_line(error)}); the file is damaged or of "
            f"another format, expected a Carillon {kind} file"
        ) from None
    with file:
        _require_kind(path, file, kind, schema)
        if sealed and not found_seal:
            raise UserError(f"{path}: {_UNSEALED}")
        with _damaged_by(path, *_NONSENSE):
            require_whole(file)
        try:
            yield file
        except ConvergenceError:
            raise
        except _NONSENSE as error:
            fault = next(text for kind, text in _FAULTS.items() if isinstance(error, kind))
            raise UserError(
                f"{path}: is {fault} ({first_line(error)}); generate the file again"
            ) from error


def require_whole_h5(path: str | Path) -> None:
    """Check an HDF5 file of another program, which has no seal, before that program's rules apply.

    Raises UserError, see `require_whole`, and OSError if it is no HDF5 file.
    """
    with opened_h5(Path(path)) as file:
        require_whole(file)


def kind_of(path: str | Path, what: str) -> tuple[str, int]:
    """Kind and schema version that a file claims; no kind if it is no file of this project.

    `what`: what it should be, for messages. Raises UserError if there is no such file.
    """
    require_file(path, what)
    try:
        with opened_h5(path) as file:
            return str(_claimed(file, "kind")), int(_claimed(file, "schema_version"))
    except Exception:  # HDF5 has many ways to say that bytes make no sense
        return "", -1


def _claimed(file: h5py.File, name: str, otherwise: Any = None) -> Any:
    """An attribute of a file, if it is a single value: a list may be of any length.

    Raises KeyError if there is none, and nothing to take otherwise.
    """
    if name in file.attrs and file.attrs.get_id(name).shape == ():
        return file.attrs[name]
    if otherwise is None:
        raise KeyError(name)
    return otherwise


def h5_in_memory(content: io.BytesIO) -> h5py.File:
    """An HDF5 file that is written to memory, for formats of others.

    It keeps the order in which things are made, as netCDF-4 demands.
    """
    return h5py.File(content, "w", track_order=True)


def opened_h5(path: str | Path) -> h5py.File:
    """An HDF5 file of any kind opened for reading, without a lock.

    Files are complete or absent, so nobody writes to one that is read; and some file systems have
    no locks.
    """
    return h5py.File(path, "r", locking=False)


@contextmanager
def _damaged_by(path: Path, *faults: type[Exception]) -> Iterator[None]:
    try:
        yield
    except faults as error:
        raise UserError(
            f"{path}: is damaged ({first_line(error)}); generate the file again"
        ) from None


def _require_kind(path: Path, file: h5py.File, kind: str, schema: int) -> None:
    with _damaged_by(path, Exception):  # HDF5 has many ways to say that bytes make no sense
        stored_kind = str(_claimed(file, "kind", "something else"))
        stored_schema = int(_claimed(file, "schema_version", -1))
    if stored_kind != kind:
        raise UserError(
            f"{path}: holds {stored_kind[:LONGEST_KIND]!r}, expected a Carillon {kind} file"
        )
    if stored_schema != schema:
        raise UserError(
            f"{path}: written with {kind} schema {stored_schema}, this version reads schema "
            f"{schema}; generate the file again"
        )
