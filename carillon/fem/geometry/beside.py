"""Files that a mesh names: in its folder, and together with it no longer than a mesh may be."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from trimesh.resolvers import FilePathResolver

from carillon.errors import UserError
from carillon.limits import MESH_BYTES


class Beside:
    """Regular files in the folder of a mesh, which end, as pipes may not."""

    def __init__(self, mesh: Path) -> None:
        self._mesh = mesh
        self._folder = FilePathResolver(str(mesh))
        self._read = mesh.stat().st_size

    def get(self, name: str, length: int | None) -> bytes:
        """The first `length` bytes of the file `name`, all of them if that is None.

        Raises UserError if they are too many, which is seen before they are read, and ValueError if
        there is no such file in the folder, or it is shorter.
        """
        path = self._found(name)
        size = path.stat().st_size
        length = size if length is None else length
        if not 0 <= length <= size:
            raise ValueError(f"the file {name!r} has {size:,} bytes, the mesh says {length:,}")
        if self._read + length > MESH_BYTES:
            raise UserError(
                f"{self._mesh}: is {self._read + length:,} bytes with the file {name!r} that it "
                f"names, expected at most {MESH_BYTES:,}; simplify the mesh"
            )
        self._read += length
        with open(path, "rb") as stream:
            return stream.read(length)

    def _found(self, name: str) -> Path:
        for candidate in (name.strip(), name.strip().lstrip("/"), Path(name).name):
            try:
                path = self._folder.absolute(candidate)
            except ValueError:  # it lies elsewhere
                continue
            if path.is_file():
                return path
        raise ValueError(f"no file {name!r} beside it")


class NoFiles(FilePathResolver):  # type: ignore[misc]
    """A folder in which trimesh finds no file beside a mesh: a shape has no need of materials."""

    def get(self, name: str) -> Any:
        """Raise FileNotFoundError, which trimesh takes for a file that is not there."""
        raise FileNotFoundError(name)
