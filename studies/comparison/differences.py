"""Under which conditions two folders of results were made, and where these differ."""

import json
from collections import defaultdict
from collections.abc import Iterator, Mapping
from typing import Any

from studies.base.conditions import LABELS
from studies.base.numbers import MISSING
from studies.comparison.folders import Folder
from workflow.settings import PLACES

UNIMPORTANT = ("spread", "date", "differing")
"""Conditions that may differ: how a spread is told, and what says nothing about a number."""
Difference = dict[str, str]
"""Something that differs: `what` for people, its values `before` and `now`, tables `where`."""
Told = Mapping[str, Mapping[str, str]]
"""What is told for every table, by names for people."""


def of_conditions(before: Folder, now: Folder) -> list[Difference]:
    """Conditions that differ in tables of both folders."""
    return _differing(_conditions(before), _conditions(now))


def of_configurations(before: Folder, now: Folder) -> list[Difference]:
    """Keys of the configuration that differ; none if a folder does not have one."""
    if not before.config or not now.config:
        return []
    return _differing({"": dict(_flat(before.config))}, {"": dict(_flat(now.config))})


def dates(folder: Folder) -> str:
    """First and last day on which tables of a folder were measured."""
    spans = [table.conditions["date"] for table in folder.tables.values() if table.conditions]
    days = sorted({day for text in spans for day in text.split(" to ") if day != MISSING})
    return " to ".join(dict.fromkeys([days[0], days[-1]])) if days else MISSING


def _differing(old: Told, new: Told) -> list[Difference]:
    shared = [path for path in new if path in old]
    paths_of = defaultdict(list)
    for path in shared:
        for what in {**old[path], **new[path]}:
            pair = (texts[path].get(what, MISSING) for texts in (old, new))
            paths_of[what, *pair].append(path)
    return [
        {
            **{"what": what, "before": before, "now": now},
            "where": "" if len(paths) == len(shared) else ", ".join(paths),
        }
        for (what, before, now), paths in paths_of.items()
        if before != now
    ]


def _conditions(folder: Folder) -> Told:
    texts = {path: table.conditions for path, table in folder.tables.items()}
    return {path: dict(_named(each.texts)) for path, each in texts.items() if each}


def _named(conditions: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    """Conditions by their names for people, each package's version as one of its own."""
    for key, text in conditions.items():
        pairs = [pair.split(" ") for pair in text.split(", ")] if key == "versions" else [[]]
        if all(len(pair) == 2 for pair in pairs):
            yield from ((name, version) for name, version in pairs)
        elif key not in UNIMPORTANT:
            yield LABELS[key], text


def _flat(config: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, str]]:
    """Keys with their sections, but for places, and values as one writes them."""
    for key, value in config.items():
        name = f"{above}{key}"
        if isinstance(value, Mapping) and value:
            yield from _flat(value, f"{name}.")
        elif name not in PLACES:
            yield name, value if isinstance(value, str) else json.dumps(value, default=str)
