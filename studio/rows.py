"""Regions and supports as the settings of a document hold them: rows, some not placed yet."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from carillon.composition.entries import RegionEntry, SupportEntry
from carillon.errors import UserError
from carillon.parameters.documents import parameters_from

Row = Mapping[str, Any]
"""Keys of a region or support as a project's file has them; `painted` may be empty yet."""
MODELS: Mapping[str, type[RegionEntry] | type[SupportEntry]] = {
    "regions": RegionEntry,
    "supports": SupportEntry,
}
KINDS = tuple(MODELS)


def rows_of(settings: Mapping[str, Any], kind: str) -> list[Row]:
    """Rows of a document's settings, `regions` or `supports`; a list of its own."""
    return list(settings.get(kind) or ())


def is_complete(row: Row) -> bool:
    """Whether a row has a place; one to be painted has none while nothing is."""
    return row.get("painted") != []


def complete(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Settings without the rows that have no place yet."""
    kept = dict(settings)
    for kind in KINDS:
        if kind in kept:
            kept[kind] = [row for row in kept[kind] or () if is_complete(row)]
            if not kept[kind]:
                del kept[kind]
    return kept


def told(row: Row, kind: str, fault: str | None, sentence: str | None) -> dict[str, Any]:
    """A row as pages are told it: how many places are painted, and what is wrong with it.

    That is its own `fault`, or a sentence about the solid if it names this row.
    """
    shown = {key: value for key, value in row.items() if key != "painted"}
    dabs = len(row["painted"]) if row.get("painted") is not None else None
    if fault is None and sentence is not None and _is_about(row, kind, sentence):
        fault = sentence
    return {**shown, "dabs": dabs, "fault": fault}


def _is_about(row: Row, kind: str, sentence: str) -> bool:
    if kind == "regions":
        return f"region {row['name']!r}" in sentence
    try:
        entry = parameters_from(row, SupportEntry)
    except UserError:
        return False
    return isinstance(entry, SupportEntry) and entry.label in sentence
