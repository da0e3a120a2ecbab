"""What code a result depends on, so that a change of that code, and of no other, makes it anew.

Snakemake compares the parameters of a rule with those of its last run. A rule therefore has the
fingerprint of the modules that do its work as one of its parameters. Comments, docstrings and help
texts do not count.
"""

import hashlib
from collections.abc import Iterable
from functools import cache
from pathlib import Path

from carillon import ROOMS
from carillon.processes import rooms
from workflow import source_files

ROOT = Path(__file__).resolve().parent.parent
"""Folder of the rooms."""
SURFACE = ["carillon", "api"]
"""Module that users import and nothing in the project does; it names all rooms."""
OF_CARILLON = Path(rooms.PARENT)
"""Folder of `carillon`, another one if that is installed."""


def fingerprint(*modules: str) -> str:
    """Short SHA-256 of modules of the project and of all that they import from it.

    Raises ValueError if the project has no such module.

    `modules`: names such as `dataset_gen.generate`.
    """
    digest = hashlib.sha256()
    for path in sorted(_needed(modules)):
        root = ROOT if path.is_relative_to(ROOT) else OF_CARILLON
        digest.update(str(path.relative_to(root)).encode())
        digest.update(_content(path))
    return digest.hexdigest()[:16]


def _needed(modules: Iterable[str]) -> set[Path]:
    """Files of the modules, of what they import, and of the data beside them that they name."""
    files: set[Path] = set()
    for name in modules:
        path = _file_of(name)
        if path is None:
            raise ValueError(f"there is no module {name} in {ROOT}")
        files.add(path)
    waiting = list(files)
    while waiting:
        imported, data = _named_in(waiting.pop())
        waiting.extend(imported - files)
        files |= imported | data
    return files


@cache
def _file_of(module: str) -> Path | None:
    """File of a module of the project; None if it is another package's, or no module."""
    parts = module.split(".")
    if parts[0] not in ROOMS or parts[:2] == SURFACE:
        return None
    for root in (ROOT, OF_CARILLON):
        path = root.joinpath(*parts)
        for candidate in (path.with_suffix(".py"), path / "__init__.py"):
            if candidate.is_file():
                return candidate
    return None


@cache
def _named_in(path: Path) -> tuple[frozenset[Path], frozenset[Path]]:
    """Modules of the project and data files of the same folder that a source file mentions."""
    source = source_files.read(path)
    modules = filter(None, map(_file_of, source.names))
    data = (path.with_name(name) for name in source.data)
    return frozenset(modules), frozenset(each for each in data if each.is_file())


@cache
def _content(path: Path) -> bytes:
    """What counts of a file: the syntax tree of a module, all bytes of another file."""
    return source_files.read(path).digest.encode() if path.suffix == ".py" else path.read_bytes()
