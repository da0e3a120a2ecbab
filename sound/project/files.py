"""Files that a new project names: copied into its folder if that is made for it."""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from carillon.errors import UserError
from carillon.files.paths import cause

_OTHERS = b"mtllib"
"""Word with which an OBJ file names others."""


class ProjectFiles:
    """Names of files in a project that lies in a folder.

    In a folder that is made for the project they are copied beside it, so that the folder can be
    opened in the studio, moved and given away. Meshes that name other files stay where they are.
    """

    def __init__(self, folder: Path, is_new: bool) -> None:
        self.folder, self.is_new = folder, is_new
        self._copies: dict[str, Path] = {}

    @property
    def copied(self) -> list[str]:
        """Names of the copies."""
        return list(self._copies)

    def named(self, path: str) -> str:
        """Name of a file in the project; an absolute one stays as it is, unless it is copied."""
        own = Path(path)
        if self.is_new and _stands_alone(own):
            return self._copy(own)
        if own.is_absolute():
            return path
        return os.path.relpath(own.parent.resolve() / own.name, self.folder.resolve())

    def _copy(self, own: Path) -> str:
        name, number = own.name, 1
        while self._copies.get(name, own).resolve() != own.resolve():
            number += 1
            name = f"{own.stem}-{number}{own.suffix}"
        self._copies[name] = own
        return name

    @contextmanager
    def written(self) -> Iterator[None]:
        """Make the folder if it is new, with the copies in it; it goes if that or the body fails.

        Raises UserError if a file cannot be copied.
        """
        if not self.is_new:
            yield
            return
        try:
            self.folder.mkdir(parents=True)
            for name, own in self._copies.items():
                shutil.copyfile(own, self.folder / name)
            yield
        except OSError as error:
            shutil.rmtree(self.folder, ignore_errors=True)
            raise UserError(f"{self.folder}: could not be written ({cause(error)})") from None
        except BaseException:
            shutil.rmtree(self.folder, ignore_errors=True)
            raise


def _stands_alone(path: Path) -> bool:
    """Whether a file names no others; clips do not, and meshes by their formats."""
    ending = path.suffix.lower()
    if ending == ".obj":
        try:
            with open(path, "rb") as file:
                return not any(line.startswith(_OTHERS) for line in file)
        except OSError:
            return False
    return path.is_file() and ending != ".gltf"
