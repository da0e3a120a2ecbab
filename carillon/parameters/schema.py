"""JSON schemas of dataclasses of parameters, for pages and documentation."""

from collections.abc import Mapping
from typing import Any

from carillon.parameters.fields import ValueDomain, parameters_of
from carillon.parameters.model import REQUIRED

_TYPES = {int: "integer", float: "number", str: "string", bool: "boolean", tuple: "array"}
_LIMITS = {"ge": "minimum", "gt": "exclusiveMinimum", "le": "maximum", "lt": "exclusiveMaximum"}


def schema_of(model: type, meaning: str = "") -> dict[str, Any]:
    """JSON schema (2020-12) of the documents that describe a model, without references.

    `meaning`: description; by default the first sentence of the model's docstring.
    """
    known = parameters_of(model)
    first = " ".join((model.__doc__ or "").partition("\n\n")[0].split()).removesuffix(".")
    properties = {}
    for name, each in known.items():
        part = {"description": _capitalised(each.meaning), **_domain(each.domain)}
        properties[name] = (
            part if each.default is REQUIRED else {**part, "default": each.plain_default}
        )
    return {
        "description": _capitalised(meaning or first),
        "type": "object",
        "additionalProperties": False,
        "required": [name for name, each in known.items() if each.default is REQUIRED],
        "properties": properties,
    }


def _domain(domain: ValueDomain) -> dict[str, Any]:
    if domain.is_section:
        return schema_of(domain.kind, domain.meaning)
    if domain.choices:
        return {"enum": [*domain.choices, *[None] * domain.nullable]}
    types = [
        _TYPES.get(domain.kind, "object"),
        *["string"] * bool(domain.words),
        *["null"] * domain.nullable,
    ]
    part: dict[str, Any] = {"type": types if len(types) > 1 else types[0], **_limits(domain)}
    if domain.words:
        part["pattern"] = f"^{'|'.join(domain.words)}\\Z"
    if domain.kind is tuple:
        part["items"] = _domain(domain.items[0])
        if not domain.endless:
            part |= {"minItems": len(domain.items), "maxItems": len(domain.items)}
    if domain.kind is dict:
        part["additionalProperties"] = _domain(domain.items[0])
    return part


def _limits(domain: ValueDomain) -> Mapping[str, float]:
    what = "Items" if domain.kind is tuple else "Length"
    names = {**_LIMITS, "min_length": f"min{what}", "max_length": f"max{what}"}
    return {names[key]: value for key, value in domain.limits.items()}


def _capitalised(text: str) -> str:
    return text[:1].upper() + text[1:]
