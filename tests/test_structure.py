"""The rooms stand in one chain, and imports point left only."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parent.parent
CHAIN = ("carillon", "dataset_gen", "forests", "solver", "sound", "workflow")


def imported_rooms(source: Path) -> set[str]:
    rooms = set()
    for node in ast.walk(ast.parse(source.read_text())):
        if isinstance(node, ast.Import):
            rooms |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            rooms.add(node.module.split(".")[0])
    return rooms & set(CHAIN)


@pytest.mark.parametrize("room", CHAIN)
def test_imports_point_left_only(room):
    left = set(CHAIN[: CHAIN.index(room) + 1])
    sources = list((CHECKOUT / room).rglob("*.py"))
    assert sources
    for source in sources:
        assert imported_rooms(source) <= left, source
