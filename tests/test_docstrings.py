"""Docstrings of what is public are numpydoc: every entry of a section has its description below."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.programs import CHECKOUT

ROOMS = ("carillon", "dataset_gen", "forests", "solver", "sound", "studio", "workflow")
"""Packages whose docstrings keep to it."""

SECTIONS = ("Parameters", "Returns", "Yields", "Raises", "Attributes")
"""Sections made of entries: `name : type`, `name` or, of errors and what is returned, a type."""
RULE = re.compile("-{3,}")


def docstrings(path: Path) -> Iterator[tuple[str, str]]:
    """Name and docstring of what is public in a module, and of the module."""
    definitions = (ast.Module, ast.ClassDef, ast.FunctionDef)
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, definitions) and (text := ast.get_docstring(node)):
            name = getattr(node, "name", path.stem)
            if not name.startswith("_") or name == "__init__":
                yield name, text


def sections(docstring: str) -> Iterator[tuple[str, list[str]]]:
    """Head and lines of each section that is made of entries."""
    lines = docstring.splitlines()
    heads = [n for n in range(len(lines) - 1) if RULE.fullmatch(lines[n + 1])]
    for head, following in zip(heads, [*heads[1:], len(lines)]):
        if lines[head] in SECTIONS:
            yield lines[head], [line for line in lines[head + 2 : following] if line]


def faults(lines: list[str]) -> Iterator[str]:
    """Lines of a section that are neither an entry with a description nor a description."""
    indented = [line.startswith("    ") for line in [*lines, ""]]
    for number, line in enumerate(lines):
        if not indented[number] and not indented[number + 1]:
            yield line


@pytest.mark.parametrize("room", ROOMS)
def test_every_entry_of_a_docstring_has_an_indented_description(room):
    found = [
        f"{path.relative_to(CHECKOUT)}: {name}, {head}: {line}"
        for path in sorted((CHECKOUT / room).rglob("*.py"))
        for name, docstring in docstrings(path)
        for head, lines in sections(docstring)
        for line in (faults(lines) if lines else ["is empty"])
    ]
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        (["young : (m, 8)", "    Moduli [Pa]."], []),
        (["young", "    Moduli", "    [Pa].", "UserError", "    If not."], []),
        (["young : moduli [Pa]."], ["young : moduli [Pa]."]),
        (["young : moduli,", "    in Pa.", "edge : [m]"], ["edge : [m]"]),
        (["Moduli", "as they are."], ["Moduli", "as they are."]),
    ],
)
def test_what_is_no_entry_is_told(lines, expected):
    assert list(faults(lines)) == expected
