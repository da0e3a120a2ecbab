"""What a source file says to those who follow its imports, read once as long as it stays the same.

Reading all files of the project takes a second, at every start of Snakemake and in every job of a
cluster; what was read is therefore kept beside the compiled modules.
"""

import ast
import atexit
import hashlib
import json
import sys
from collections.abc import Iterator, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import NamedTuple

from carillon.errors import UserError
from carillon.files.atomic import atomic_path

KEPT = Path(__file__).parent / "__pycache__" / f"{Path(__file__).stem}-{sys.hexversion:x}.json"
_TEXTS = frozenset({"help", "description", "metavar"})
_DATA = (".json", ".css", ".j2", ".yaml")


class Source(NamedTuple):
    """A source file."""

    names: Sequence[str]
    """What it imports, with the packages these lie in; some may be no modules."""
    data: Sequence[str]
    """Names of data files that it mentions."""
    digest: str
    """SHA-256 of its syntax tree without docstrings and help texts."""


_asked: set[str] = set()


def read(path: Path) -> Source:
    """What a source file says.

    Raises OSError, SyntaxError if it is no file of Python.
    """
    content = path.read_bytes()
    version = hashlib.sha256(content).hexdigest()
    _asked.add(version)
    known = _known()
    if version not in known:
        known[version] = _parsed(content)
        _keep_at_exit()
    return known[version]


@cache
def _known() -> dict[str, Source]:
    """What earlier runs have read, by the digest of the file's bytes."""
    with suppress(OSError, ValueError, TypeError, AttributeError):
        kept = json.loads(KEPT.read_bytes())
        return {version: Source(*source) for version, source in kept.items()}
    return {}


@cache
def _keep_at_exit() -> None:
    atexit.register(_keep)


def _keep() -> None:
    """Write down what this run has asked for; where that is impossible, it is read again."""
    known = {version: source for version, source in _known().items() if version in _asked}
    with suppress(OSError, UserError):
        KEPT.parent.mkdir(exist_ok=True)
        with atomic_path(KEPT) as temporary:
            temporary.write_text(json.dumps(known))


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
    return Source(sorted(names), sorted(data), digest)


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
