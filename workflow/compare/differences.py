"""Under which conditions two folders of results were made, and where these differ."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from workflow.compare.folders import Folder
from workflow.report.conditions import LABELS, Conditions
from workflow.report.numbers import MISSING
from workflow.settings import PLACES

UNIMPORTANT = ("spread", "date", "differing")
"""Conditions that may differ: how a spread is told, and what says nothing about a number."""


@dataclass(frozen=True)
class Difference:
    """A condition or a key of the configuration that is not the same.

    Attributes
    ----------
    what : the condition for people, or the key.
    before, now : its values.
    where : tables that it holds for; empty for all, or for the configuration.
    """

    what: str
    before: str
    now: str
    where: str = ""


def of_conditions(before: Folder, now: Folder) -> list[Difference]:
    """Conditions that differ in tables of both folders."""
    shared = [
        path
        for path, table in now.tables.items()
        if table.conditions and path in before.tables and before.tables[path].conditions
    ]
    found: dict[tuple[str, str, str], list[str]] = {}
    for path in shared:
        old, new = before.tables[path].conditions, now.tables[path].conditions
        assert old is not None and new is not None
        for difference in _told_otherwise(old, new):
            found.setdefault(difference, []).append(path)
    return [
        Difference(*difference, "" if len(paths) == len(shared) else ", ".join(paths))
        for difference, paths in found.items()
    ]


def _told_otherwise(old: Conditions, new: Conditions) -> Iterator[tuple[str, str, str]]:
    for key, label in LABELS.items():
        before, now = getattr(old, key), getattr(new, key)
        if key in UNIMPORTANT or before == now:
            continue
        if key == "versions":
            yield from _versions(before, now)
        else:
            yield label, before, now


def _versions(before: str, now: str) -> Iterator[tuple[str, str, str]]:
    """Packages whose version differs; all of them if one is not told as expected."""
    try:
        old, new = (dict(pair.split(" ") for pair in text.split(", ")) for text in (before, now))
    except ValueError:
        yield LABELS["versions"], before, now
        return
    for package in dict.fromkeys([*old, *new]):
        if old.get(package) != new.get(package):
            yield package, old.get(package, MISSING), new.get(package, MISSING)


def of_configurations(before: Folder, now: Folder) -> list[Difference]:
    """Keys of the configuration that differ; none if a folder does not have one."""
    if not before.config or not now.config:
        return []
    old, new = (dict(_flat(folder.config)) for folder in (before, now))
    return [
        Difference(key, old.get(key, MISSING), new.get(key, MISSING))
        for key in dict.fromkeys([*old, *new])
        if old.get(key) != new.get(key) and key not in PLACES
    ]


def _flat(config: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, str]]:
    """Keys with their sections, and values as one writes them."""
    for key, value in config.items():
        name = f"{above}{key}"
        if isinstance(value, Mapping) and value:
            yield from _flat(value, f"{name}.")
        else:
            yield name, value if isinstance(value, str) else json.dumps(value, default=str)


def dates(folder: Folder) -> str:
    """First and last day on which tables of a folder were measured."""
    told = [table.conditions.date for table in folder.tables.values() if table.conditions]
    days = sorted({day for text in told for day in text.split(" to ") if day != MISSING})
    return " to ".join(dict.fromkeys([days[0], days[-1]])) if days else MISSING
