"""Keys of dataclasses of parameters as lists: type, limits, unit, default and meaning."""

import inspect
import json
from collections.abc import Iterator
from dataclasses import asdict, is_dataclass
from typing import Any

from carillon.parameters import REQUIRED
from carillon.parameters.fields import Parameter, ValueDomain, parameters_of

_KINDS = {int: "integer", float: "number", str: "text", bool: "boolean", tuple: "list"}
_BOUNDS = {"ge": "at least {}", "gt": "above {}", "le": "at most {}", "lt": "below {}"}
_LENGTHS = {"min_length": "at least {} long", "max_length": "at most {} long"}


def sections(model: type, plain_title: str) -> str:
    """Sections with the keys of a document: its plain keys, then those of every part."""
    known = parameters_of(model).values()
    plain = [each for each in known if not _nested(each.domain)]
    parts = [f"## {plain_title}", *_entries(plain, "")]
    for each in known:
        if nested := _nested(each.domain):
            required = " Required." if each.default is REQUIRED else ""
            parts += [f"## {each.name}", f"{_meaning(each)}.{required}"]
            parts += _entries(parameters_of(nested).values(), f"{_named(each)}.")
    return "\n\n".join(parts) + "\n"


def _nested(domain: ValueDomain) -> Any:
    """The dataclass that a value is, or each of its entries; None if they have no keys."""
    if domain.is_section:
        return domain.kind
    return domain.items[0].kind if domain.items and domain.items[0].is_section else None


def _named(each: Parameter) -> str:
    """Name of a part whose keys follow: with a place for the name or number of an entry."""
    return each.name + {dict: ".NAME", tuple: "[]"}.get(each.domain.kind, "")


def _meaning(each: Parameter) -> str:
    text = each.meaning or (inspect.getdoc(each.domain.kind) or "").split("\n\n")[0]
    text = " ".join(text.split()).rstrip(".")
    unit = f" [{each.domain.unit or 1}]"
    return text[:1].upper() + text[1:].removesuffix(unit)


def _entries(known: Any, prefix: str) -> Iterator[str]:
    """Each key with its type, unit and default, and what it means; then the keys below it."""
    for each in known:
        unit = f" [{each.domain.unit}]" if each.domain.unit else ""
        facts = [_type(each.domain) + unit, _default(each)]
        yield f"`{prefix}{each.name}` {'; '.join(filter(None, facts))}\n: {_meaning(each)}."
        if nested := _nested(each.domain):
            yield from _entries(parameters_of(nested).values(), f"{prefix}{_named(each)}.")


def _type(domain: ValueDomain) -> str:
    null = ["null"] if domain.nullable else []
    if domain.choices:
        return " or ".join(["one of " + ", ".join(f"`{each}`" for each in domain.choices), *null])
    words = [_KINDS.get(domain.kind, "keys and values"), *map("`{}`".format, domain.words), *null]
    kind = " or ".join(words)
    if domain.kind is tuple and not _nested(domain):
        kind += f" of ({_type(domain.items[0])})"
        kind += "" if domain.endless else f", {len(domain.items)} long"
    known = _LENGTHS if domain.kind in (tuple, dict) else _BOUNDS
    limits = domain.limits
    bounds = [known[name].format(_number(limits[name])) for name in known if name in limits]
    reasons = dict.fromkeys(filter(None, domain.reasons.values()))
    why = f", since {' and '.join(reasons)}" if reasons else ""
    return ", ".join([kind, *bounds]) + why


def _number(value: float) -> str:
    return f"{value:,}" if isinstance(value, int) else f"{value:g}"


def _default(each: Parameter) -> str:
    if each.default is REQUIRED:
        return "required"
    if is_dataclass(each.default):
        return ""
    return f"default `{json.dumps(each.default, ensure_ascii=False, default=_plain)}`"


def _plain(value: Any) -> dict[str, Any]:
    own = {name: each.default for name, each in parameters_of(type(value)).items()}
    return {name: given for name, given in asdict(value).items() if given != own[name]}
