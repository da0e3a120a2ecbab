"""Under which conditions two folders of results were made, and where these differ."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

from workflow.settings import PLACES
from workflow.studies.base.conditions import LABELS
from workflow.studies.base.numbers import MISSING
from workflow.studies.comparison.folders import Folder

UNIMPORTANT = ("spread", "date", "differing")
"""Conditions that may differ: how a spread is told, and what says nothing about a number."""
Difference = dict[str, str]
"""What is not the same: `what` for people, its values `before` and `now`, tables `where`."""


def of_conditions(before: Folder, now: Folder) -> list[Difference]:
    """Conditions that differ in tables of both folders."""
    old, new = _texts_by_table(before), _texts_by_table(now)
    shared = [path for path in new if path in old]
    tables: dict[tuple[str, str, str], list[str]] = {}
    for path in shared:
        for difference in _differing(old[path], new[path]):
            tables.setdefault(difference, []).append(path)
    return [
        _difference(*difference, where="" if len(paths) == len(shared) else ", ".join(paths))
        for difference, paths in tables.items()
    ]


def of_configurations(before: Folder, now: Folder) -> list[Difference]:
    """Keys of the configuration that differ; none if a folder does not have one."""
    if not before.config or not now.config:
        return []
    old, new = (dict(_flat(folder.config)) for folder in (before, now))
    return [_difference(*each) for each in _differing(old, new) if each[0] not in PLACES]


def dates(folder: Folder) -> str:
    """First and last day on which tables of a folder were measured."""
    texts = [table.conditions.date for table in folder.tables.values() if table.conditions]
    days = sorted({day for text in texts for day in text.split(" to ") if day != MISSING})
    return " to ".join(dict.fromkeys([days[0], days[-1]])) if days else MISSING


def _difference(what: str, before: str, now: str, where: str = "") -> Difference:
    return {"what": what, "before": before, "now": now, "where": where}


def _differing(old: Mapping[str, str], new: Mapping[str, str]) -> Iterator[tuple[str, str, str]]:
    for what in dict.fromkeys([*old, *new]):
        before, now = old.get(what, MISSING), new.get(what, MISSING)
        if before != now:
            yield what, before, now


def _texts_by_table(folder: Folder) -> dict[str, dict[str, str]]:
    by_table = {path: table.conditions for path, table in folder.tables.items()}
    return {path: _texts(each.texts) for path, each in by_table.items() if each}


def _texts(conditions: Mapping[str, str]) -> dict[str, str]:
    """Conditions by their names for people, each package's version as one of its own."""
    texts: dict[str, str] = {}
    for key, text in conditions.items():
        if key == "versions":
            pairs = [pair.split(" ") for pair in text.split(", ")]
            plain = all(len(pair) == 2 for pair in pairs)
            texts |= dict(pairs) if plain else {LABELS[key]: text}
        elif key not in UNIMPORTANT:
            texts[LABELS[key]] = text
    return texts


def _flat(config: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, str]]:
    """Keys with their sections, and values as one writes them."""
    for key, value in config.items():
        name = f"{above}{key}"
        if isinstance(value, Mapping) and value:
            yield from _flat(value, f"{name}.")
        else:
            yield name, value if isinstance(value, str) else json.dumps(value, default=str)
