"""Keys of the configuration, of projects and of scenes as lists, from their schemas."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from typing import Any

import parameter_tables
import yaml

from sound.project.schema import SCHEMA as PROJECT_SCHEMA
from sound.project.schema import word_of
from sound.scenes.scene import SCHEMA as SCENE_SCHEMA
from workflow.configuration.whole import limits, whole

_BOUNDS = {
    "minimum": "at least {}",
    "exclusiveMinimum": "above {}",
    "maximum": "at most {}",
    "exclusiveMaximum": "below {}",
    "minItems": "at least {} long",
    "maxItems": "at most {} long",
}
_UNIT = re.compile(r"^(.*) \[([^]]+)\]$")
"""A description that ends with its unit."""

Schema = Mapping[str, Any]


def of_configuration() -> str:
    """Sections with the keys of the configuration."""
    return parameter_tables.sections(whole(), "The run") + _limits_of_rules()


def _limits_of_rules() -> str:
    """The rules' own limits as a table."""
    rows = [
        f"| `{rule}` | {each.what} | {each.memory_mb or ''} | {each.minutes} |"
        for rule, each in limits().items()
    ]
    head = ["", "| rule | a job makes | memory [MB] | time [min] |", "| --- | --- | --: | --: |"]
    return "\n".join([*head, *rows, ""])


def of_project() -> str:
    """Sections with the keys of a project."""
    return _sections(yaml.safe_load(PROJECT_SCHEMA.read_text(encoding="utf-8")), "The solid")


def of_scene() -> str:
    """Sections with the keys of a scene."""
    return _sections(yaml.safe_load(SCENE_SCHEMA.read_text(encoding="utf-8")), "The scene")


def _sections(schema: Schema, plain_title: str) -> str:
    plain = {key: part for key, part in schema["properties"].items() if not _is_section(part)}
    parts = [f"## {plain_title}", *_entries(plain, "", schema["required"])]
    for key, part in schema["properties"].items():
        if _is_section(part):
            required = _nested(part).get("required", ())
            parts += [f"## {key}", f"{part['description']}."]
            parts += _entries(_children(part), f"{_named(key, part)}.", required)
    return "\n\n".join(parts) + "\n"


def _is_section(part: Schema) -> bool:
    return bool(_children(part))


def _nested(part: Schema) -> Schema:
    """The part itself, or what each of its named entries or items is."""
    if "properties" in part:
        return part
    for name in ("additionalProperties", "items"):
        if isinstance(part.get(name), dict) and "properties" in part[name]:
            nested: Schema = part[name]
            return nested
    return {}


def _children(part: Schema) -> dict[str, Any]:
    return dict(_nested(part).get("properties", {}))


def _named(key: str, part: Schema) -> str:
    """Name of a part whose children follow: with a place for the name or number of an entry."""
    if "properties" in part:
        return key
    return f"{key}[]" if part.get("type") == "array" else f"{key}.NAME"


def _entries(parts: Mapping[str, Any], prefix: str, required: Any) -> Iterator[str]:
    """Each key with its type, unit and default, and what it means."""
    for key, part in parts.items():
        described = _UNIT.match(part["description"])
        meaning, unit = described.groups() if described else (part["description"], "1")
        default = "required" if key in required else _default(part)
        facts = [_type(part) + ("" if unit == "1" else f" [{unit}]"), default]
        yield f"`{prefix}{key}` {'; '.join(filter(None, facts))}\n: {meaning}."
        nested = _nested(part)
        below = f"{prefix}{_named(key, part)}."
        yield from _entries(_children(part), below, nested.get("required", ()))


def _type(part: Schema) -> str:
    """Type, choices and bounds in words."""
    if "enum" in part:
        return "one of " + ", ".join(f"`{choice}`" for choice in part["enum"])
    kind, word = part["type"], word_of(part)
    words = " or ".join(kind) if isinstance(kind, list) else kind
    if word is not None:
        words = words.replace("string", f"`{word}`")
    items = part.get("items")
    if isinstance(items, dict) and ("enum" in items or "properties" not in items):
        words = f"{words} of ({_type(items)})"
    bounds = [text.format(_number(part[name])) for name, text in _BOUNDS.items() if name in part]
    return ", ".join([words, *bounds])


def _number(value: float) -> str:
    return f"{value:,}" if isinstance(value, int) else f"{value:g}"


def _default(part: Schema) -> str:
    """Default of a key; that of a section is its keys' own."""
    if "default" not in part or (_children(part) and part["default"] == {}):
        return ""
    return f"default `{json.dumps(part['default'], ensure_ascii=False)}`"
