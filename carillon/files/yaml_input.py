"""YAML that people write, read with bounds; what is hostile or broken is one sentence."""

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import yaml

from carillon.errors import UserError
from carillon.files.paths import cause

MOST_BYTES = 1 << 20
"""Most bytes of a YAML file; descriptions of runs are a few kilobytes."""
DEEPEST = 32
"""Levels of lists and mappings inside each other."""

_FLOAT = re.compile(r"^[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?$")


class _Loader(yaml.SafeLoader):
    """Numbers as in YAML 1.2, dates as text, no references, bounded depth.

    PyYAML by itself takes 1e9 for text, and 2020-01-01 for a date, of which nothing here has a use.
    References (`*name`) let a few hundred bytes stand for gigabytes.
    """

    def __init__(self, stream: Any) -> None:
        super().__init__(stream)
        self._depth = 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        """Refuse references, and what is nested deeper than any description is."""
        event = self.peek_event()
        if isinstance(event, yaml.AliasEvent):
            raise _refused(event, f"found the reference *{event.anchor}; write its content out")
        if self._depth >= DEEPEST:
            raise _refused(event, f"nested deeper than {DEEPEST} levels")
        self._depth += 1
        try:
            return super().compose_node(parent, index)
        finally:
            self._depth -= 1

    def construct_mapping(self, node: Any, deep: bool = False) -> Any:
        """Refuse a key that is there twice, of which YAML would drop the first."""
        seen = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode) and key.value in seen:
                raise _refused(key, f"the key {key.value} is there twice")
            seen.add(key.value if isinstance(key, yaml.ScalarNode) else id(key))
        return super().construct_mapping(node, deep)


_Loader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if not tag.endswith(":timestamp")]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
_Loader.add_implicit_resolver("tag:yaml.org,2002:float", _FLOAT, list("-+.0123456789"))


def _refused(place: Any, problem: str) -> yaml.MarkedYAMLError:
    return yaml.MarkedYAMLError(problem=problem, problem_mark=place.start_mark)


def read_yaml(path: str | Path, what: str) -> dict[str, Any]:
    """The keys and values of a YAML file, see `read_marked`."""
    return read_marked(path, what)[0]


def read_marked(path: str | Path, what: str) -> tuple[dict[str, Any], yaml.Node]:
    """The keys and values of a YAML file, and its nodes, of which `line_of` tells lines.

    Raises UserError if the file is missing, no file, too large, no YAML, nested too deeply, holds
    references or a key twice, or no keys and values. `what`: what the file should be, for messages:
    "a project".
    """
    path = Path(path)
    try:
        if not path.is_file():
            why = "is a folder" if path.is_dir() else "no such file"
            raise UserError(f"{path}: {why}, expected {what} (YAML)")
        with open(path, "rb") as stream:
            content = stream.read(MOST_BYTES + 1)
    except (OSError, ValueError) as error:
        said = cause(error) if isinstance(error, OSError) else str(error)
        raise UserError(f"{path}: cannot be read ({said}), expected {what} (YAML)") from None
    if len(content) > MOST_BYTES:
        raise UserError(f"{path}: longer than {MOST_BYTES:,} bytes, expected {what} (YAML)")
    try:
        document, node = _parsed(content.decode("utf-8-sig"))
    except (UnicodeDecodeError, UserError) as error:
        said = error.reason if isinstance(error, UnicodeDecodeError) else str(error)
        raise UserError(f"{path}: is not readable as YAML ({said}), expected {what}") from None
    if not isinstance(document, dict):
        raise UserError(f"{path}: expected {what}, keys and values (name: value), one in a line")
    return document, node


def line_of(node: yaml.Node, place: Iterable[str | int]) -> int:
    """Number of the line where a value begins, or what is nearest around it if it is missing."""
    return nearest(node, place)[1]


def nearest(node: yaml.Node, place: Iterable[str | int]) -> tuple[int, int]:
    """How many steps of the way to a place a document has, and the line where the last one is."""
    steps, line = 0, node.start_mark.line
    for part in place:
        entries = _entries(node)
        if part not in entries:
            break
        steps += 1
        line, node = entries[part]
    return steps, int(line) + 1


def _entries(node: yaml.Node) -> dict[str | int, tuple[int, yaml.Node]]:
    if isinstance(node, yaml.MappingNode):
        return {key.value: (key.start_mark.line, value) for key, value in node.value}
    if isinstance(node, yaml.SequenceNode):
        return {number: (each.start_mark.line, each) for number, each in enumerate(node.value)}
    return {}


def read_own_yaml(path: Path) -> Any:
    """What a file says that comes with the package.

    LibYAML reads it in a tenth of the time, where it is installed.
    """
    with path.open("rb") as stream:
        return yaml.load(stream, getattr(yaml, "CSafeLoader", yaml.SafeLoader))


def parse_yaml(text: str) -> Any:
    """What a text in YAML says.

    Raises UserError if it is no YAML, nested too deeply, or holds references or a key twice.

    Examples
    --------
    >>> parse_yaml("{young: 1e9, date: 2020-01-01}")
    {'young': 1000000000.0, 'date': '2020-01-01'}
    >>> parse_yaml("[&a [1, 2], *a]")
    Traceback (most recent call last):
    carillon.errors.UserError: line 1: found the reference *a; write its content out
    """
    return _parsed(text)[0]


def _parsed(text: str) -> tuple[Any, Any]:
    """Values of a YAML text, and the node that they were made from."""
    try:
        loader = _Loader(text)
        node = loader.get_single_node()
        return (None if node is None else loader.construct_document(node)), node
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f"line {mark.line + 1}: " if mark is not None else ""
        raise UserError(f"{where}{error.problem or error.context}") from None
    except (yaml.YAMLError, ValueError, TypeError) as error:
        raise UserError(str(error)) from None
