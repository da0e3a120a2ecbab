"""HDF5 files that are complete or absent: written aside, flushed to disk, then renamed."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py

from carillon.errors import UserError


def require_writable(path: str | Path) -> Path:
    """Check, before hours of work, that a result can be written to `path`.

    Raises
    ------
    UserError
        If the folder is missing or not writable, or `path` names a folder.
    """
    path = Path(path)
    folder = path.parent if str(path.parent) else Path(".")
    if path.is_dir():
        raise UserError(f"{path}: is a folder, expected the name of a file to write")
    if not folder.is_dir():
        raise UserError(
            f"{path}: cannot be written, the folder {folder} does not exist; create it first"
        )
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise UserError(
            f"{path}: cannot be written ({error.strerror}); name a folder you may write to"
        ) from None
    return path


@contextmanager
def atomic_path(path: str | Path) -> Iterator[Path]:
    """Yield a temporary name beside `path`; on success fsync it and rename it to `path`.

    When the body raises, the temporary file is removed and `path` stays as it was.
    """
    path = require_writable(path)
    handle, name = tempfile.mkstemp(
        prefix=f".{path.name}.", suffix=f".partial{path.suffix}", dir=path.parent
    )
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        umask = os.umask(0)
        os.umask(umask)
        os.chmod(temporary, 0o666 & ~umask)
        with open(temporary, "rb+") as stream:
            os.fsync(stream.fileno())
        os.replace(temporary, path)
    except OSError as error:
        raise UserError(f"{path}: could not be written ({error})") from error
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def create_h5(path: str | Path, kind: str, schema: int) -> Iterator[h5py.File]:
    """Create the HDF5 file `path` atomically, marked with its kind and schema version."""
    with atomic_path(path) as temporary:
        with h5py.File(temporary, "w") as file:
            file.attrs["kind"] = kind
            file.attrs["schema_version"] = schema
            yield file


@contextmanager
def open_h5(path: str | Path, kind: str, schema: int) -> Iterator[h5py.File]:
    """Open the HDF5 file `path` for reading and check that it is what it should be.

    Raises
    ------
    UserError
        If the file is missing, damaged, of another kind, or of another schema version.
    """
    path = Path(path)
    if not path.is_file():
        raise UserError(f"{path}: no such file, expected a Carillon {kind} file (HDF5)")
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        raise UserError(
            f"{path}: is not readable as HDF5 ({_first_line(error)}); the file is damaged or of "
            f"another format, expected a Carillon {kind} file"
        ) from None
    with file:
        found_kind = file.attrs.get("kind")
        if found_kind != kind:
            raise UserError(
                f"{path}: holds {found_kind or 'something else'!r}, expected a Carillon {kind} file"
            )
        found = int(file.attrs.get("schema_version", -1))
        if found != schema:
            raise UserError(
                f"{path}: written with {kind} schema {found}, this version reads schema {schema}; "
                f"generate the file again"
            )
        try:
            yield file
        except OSError as error:
            raise UserError(
                f"{path}: is damaged ({_first_line(error)}); generate the file again"
            ) from None
        except KeyError as error:
            raise UserError(
                f"{path}: is incomplete ({_first_line(error)}); generate the file again"
            ) from None


def _first_line(error: BaseException) -> str:
    return str(error).strip("'\"").splitlines()[0]
