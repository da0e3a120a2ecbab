"""What code a result depends on, so that a change of that code, and of no other, makes it anew.

Snakemake compares the parameters of a rule with those of its last run. A rule therefore has the
fingerprint of the modules that do its work as one of its parameters. Comments, docstrings and help
texts do not count.
"""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
ENTRY = ".__main__"
"""End of the name of a command line, whose own source counts but not all that it can start."""
_TEXTS = frozenset({"help", "description", "metavar"})
_DATA = (".json", ".css", ".j2", ".yaml")


def fingerprint(*modules: str) -> str:
    """Short SHA-256 of modules of the project and of all that they import from it.

    Parameters
    ----------
    modules : names such as `dataset_gen.generate`; for `PACKAGE.__main__` the file alone.

    Raises
    ------
    ValueError
        If the project has no such module.
    """
    digest = hashlib.sha256()
    for path in sorted(_needed(modules)):
        digest.update(str(path.relative_to(ROOT)).encode())
        digest.update(_content(path))
    return digest.hexdigest()[:16]


def _needed(modules: Iterable[str]) -> set[Path]:
    """Files of the modules, of what they import, and of the data beside them that they name."""
    found: set[Path] = set()
    waiting = []
    for name in modules:
        path = _file_of(name)
        if path is None:
            raise ValueError(f"there is no module {name} in {ROOT}")
        found.add(path)
        if not name.endswith(ENTRY):
            waiting.append(path)
    while waiting:
        named, data = _named_in(waiting.pop())
        found.update(data)
        new = {path for path in map(_file_of, named) if path is not None} - found
        found |= new
        waiting.extend(new)
    return found


@cache
def _file_of(module: str) -> Path | None:
    """File of a module of the project; None if it is another package's, or no module."""
    path = ROOT.joinpath(*module.split("."))
    for candidate in (path.with_suffix(".py"), path / "__init__.py"):
        if candidate.is_file():
            return candidate
    return None


@cache
def _named_in(path: Path) -> tuple[frozenset[str], frozenset[Path]]:
    """Names that may be modules, and files of the same folder, that a source file mentions."""
    names, data, _ = _read(path)
    packages = {parent for name in names for parent in _parents(name)}
    return frozenset(names | packages), frozenset(data)


def _data_beside(path: Path, text: str) -> list[Path]:
    """The data file beside a source file that a text names, if there is one."""
    return [path.with_name(text)] if _is_data(text) and path.with_name(text).is_file() else []


def _is_data(text: str) -> bool:
    return text.endswith(_DATA) and "/" not in text


def _parents(name: str) -> Iterator[str]:
    """Packages that are imported before a module of theirs."""
    parts = name.split(".")
    return (".".join(parts[:end]) for end in range(1, len(parts)))


@cache
def _content(path: Path) -> bytes:
    """What counts of a file: the syntax tree of a module, all bytes of another file."""
    return _read(path)[2] if path.suffix == ".py" else path.read_bytes()


@cache
def _read(path: Path) -> tuple[set[str], set[Path], bytes]:
    """Imported names, data files beside it, and syntax tree of a source file.

    The tree is without docstrings and help texts.
    """
    names: set[str] = set()
    data: set[Path] = set()
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)):
            # A string that stands alone, wherever: of attributes as well.
            node.body = [part for part in node.body if not _is_text(part)]
        elif isinstance(node, ast.Call):
            node.keywords = [part for part in node.keywords if part.arg not in _TEXTS]
        elif isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names.add(node.module)
            names.update(f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            data.update(_data_beside(path, node.value))
    return names, data, ast.dump(tree).encode()


def _is_text(statement: ast.stmt) -> bool:
    return (
        isinstance(statement, ast.Expr)
        and isinstance(statement.value, ast.Constant)
        and isinstance(statement.value.value, str)
    )
