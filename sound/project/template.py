"""A project file with all keys, each with what it means."""

from collections.abc import Iterator, Mapping
from typing import Any

import yaml

from carillon.parameters.schema import schema_of
from sound.project.project import Project

_STEP = "  "


def project_text(values: Mapping[str, Any]) -> str:
    """A project (YAML) of given keys and values; those of a section or of a list's entries are a
    mapping.

    All other keys are there too, each with its default behind a #.
    """
    schema = schema_of(Project)
    lines = [f"# {schema['description']}", "# Keys behind a # have the value that stands there."]
    for key, part in schema["properties"].items():
        lines += ["", *_entry(key, part, values)]
    return "\n".join(lines) + "\n"


def _entry(key: str, part: Mapping[str, Any], values: Mapping[str, Any]) -> Iterator[str]:
    """Lines of a key: what it means, then its name and value, or the keys below it."""
    yield f"# {_meaning(part)}"
    if "properties" in part.get("items", {}) and values.get(key):
        yield f"{key}:"
        yield from _items(part["items"]["properties"], values[key])
        return
    mark = "" if key in values else "#"
    if "properties" not in part:
        yield f"{mark}{key}: {_shown(values.get(key, part.get('default')))}"
        return
    # A section without keys would be no section.
    given = values.get(key) or {name: each["default"] for name, each in part["properties"].items()}
    yield f"{mark}{key}:"
    for name, each in part["properties"].items():
        yield from (f"{mark}{_STEP}{line}" for line in _entry(name, each, given))


def _items(keys: Mapping[str, Any], entries: list[dict[str, Any]]) -> Iterator[str]:
    """Lines of a list of entries; what their keys mean stands in the first one alone."""
    for number, entry in enumerate(entries):
        lines = [
            line
            for name, part in keys.items()
            for line in _entry(name, part, entry)
            if number == 0 or not line.startswith("#")
        ]
        first = next(k for k, line in enumerate(lines) if not line.startswith("#"))
        for k, line in enumerate(lines):
            yield f"{_STEP}{'- ' if k == first else _STEP}{line}"


def _meaning(part: Mapping[str, Any]) -> str:
    meaning: str = part["description"]
    choices = [choice for choice in part.get("enum", []) if choice is not None]
    named = all(choice in meaning for choice in choices)
    return meaning if named else f"{meaning} ({', '.join(choices)})"


def _shown(value: Any) -> str:
    width = float("inf")
    text = yaml.safe_dump(value, default_flow_style=True, allow_unicode=True, width=width)
    return text.removesuffix("...\n").strip()
