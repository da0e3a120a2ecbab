"""What a source file says to those who follow its imports, read once as long as it stays the same.

Reading all files of the project takes a second, at every start of Snakemake and in every job of a
cluster; what was read is therefore kept beside the compiled modules.
"""

from __future__ import annotations

import ast
import atexit
import hashlib
import json
import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import astuple, dataclass
from functools import cache
from pathlib import Path

from carillon.errors import UserError
from carillon.files import atomic_path

PROJECT = Path(__file__).resolve().parent.parent
KEPT = Path(__file__).parent / "__pycache__" / f"{Path(__file__).stem}-{sys.hexversion:x}.json"
_TEXTS = frozenset({"help", "description", "metavar"})
_DATA = (".json", ".css", ".j2", ".yaml")


@dataclass(frozen=True)
class Source:
    """A source file.

    Attributes
    ----------
    names
        What it imports, with the packages these lie in; some may be no modules.
    data
        Names of data files that it mentions.
    digest
        SHA-256 of its syntax tree without docstrings and help texts.
    """

    names: tuple[str, ...]
    data: tuple[str, ...]
    digest: str


def read(path: Path) -> Source:
    """What a source file says.

    Raises
    ------
    OSError, SyntaxError
        If it is no file of Python.
    """
    content = path.read_bytes()
    version = hashlib.sha256(content).hexdigest()
    known = _known()
    if str(path) not in known or known[str(path)][0] != version:
        known[str(path)] = (version, _parsed(content))
        _keep_at_exit()
    return known[str(path)][1]


@cache
def _known() -> dict[str, tuple[str, Source]]:
    """What earlier runs have read, by path: the digest of the file's bytes, and what they say."""
    with suppress(OSError, ValueError, TypeError, AttributeError):
        return {
            path: (version, Source(tuple(names), tuple(data), digest))
            for path, (version, (names, data, digest)) in json.loads(KEPT.read_bytes()).items()
        }
    return {}


@cache
def _keep_at_exit() -> None:
    atexit.register(_keep)


def _keep() -> None:
    """Write down what was read of this project; where that is impossible, it is read again."""
    known = {path: (version, astuple(source)) for path, (version, source) in _known().items()}
    with suppress(OSError, UserError):
        KEPT.parent.mkdir(exist_ok=True)
        with atomic_path(KEPT) as temporary:
            temporary.write_text(
                json.dumps({path: each for path, each in known.items() if _is_own(path)})
            )


def _is_own(path: str) -> bool:
    return Path(path).is_relative_to(PROJECT) and Path(path).is_file()


def _parsed(content: bytes) -> Source:
    names: set[str] = set()
    data: set[str] = set()
    tree = ast.parse(content)
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
        elif (
            isinstance(node, ast.Constant) and isinstance(node.value, str) and _is_data(node.value)
        ):
            data.add(node.value)
    names.update({parent for name in names for parent in _parents(name)})
    digest = hashlib.sha256(ast.dump(tree).encode()).hexdigest()
    return Source(tuple(sorted(names)), tuple(sorted(data)), digest)


def _parents(name: str) -> Iterator[str]:
    """Packages that are imported before a module of theirs."""
    parts = name.split(".")
    return (".".join(parts[:end]) for end in range(1, len(parts)))


def _is_data(text: str) -> bool:
    return text.endswith(_DATA) and "/" not in text


def _is_text(statement: ast.stmt) -> bool:
    return (
        isinstance(statement, ast.Expr)
        and isinstance(statement.value, ast.Constant)
        and isinstance(statement.value.value, str)
    )
