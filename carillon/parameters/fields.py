"""Fields of a dataclass of parameters: values, limits and meaning, read from annotations."""

from __future__ import annotations

import dataclasses
import re
import types
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from carillon.parameters.model import REQUIRED, Check, OneOf

_LIMITS = ("ge", "gt", "le", "lt", "min_length", "max_length")


@dataclass(frozen=True)
class ValueDomain:
    """The values that an annotation admits."""

    kind: Any
    """int, float, str, bool, tuple, dict, or a dataclass; str if a check makes it of a text."""
    meaning: str = ""
    """What they are, with the unit in brackets; empty if the annotation does not say."""
    limits: Mapping[str, float] = field(default_factory=dict)
    """By the names of `annotated_types`: ge, gt, le, lt, min_length, max_length."""
    reasons: Mapping[str, str] = field(default_factory=dict)
    """Reasons for those limits that have one to tell."""
    choices: tuple[str, ...] = ()
    """Texts that are admitted, if not all are."""
    words: tuple[str, ...] = ()
    """Texts that are admitted in place of a value of this kind, such as auto."""
    nullable: bool = False
    """Whether None is admitted."""
    items: tuple[ValueDomain, ...] = ()
    """Domains of the items of a tuple, or of the values of a dict."""
    endless: bool = False
    """Whether a tuple has any number of the one item."""
    is_union: bool = False
    """Whether pydantic names the kind that it tried in the places of mistakes."""
    annotation: Any = None
    """What was read; without None."""

    @property
    def is_section(self) -> bool:
        """Whether values have keys of their own."""
        return dataclasses.is_dataclass(self.kind)

    @property
    def unit(self) -> str:
        """Unit of the values; empty for numbers without one."""
        return unit_of(self.meaning)


def unit_of(meaning: str) -> str:
    """The unit in a meaning, if there is one.

    Examples
    --------
    >>> unit_of("mass density [kg/m^3]"), unit_of("number of modes [1]"), unit_of("a name")
    ('kg/m^3', '', '')
    """
    units = re.findall(r"\[([^]]+)\]", meaning)
    return units[0] if len(units) == 1 and units != ["1"] else ""


@dataclass(frozen=True)
class Parameter:
    """A field: its name, its default (`REQUIRED` for none), the values it takes, what it means."""

    name: str
    default: Any
    domain: ValueDomain
    meaning: str
    annotation: Any
    metavar: str | tuple[str, ...] | None = None
    read: Any = None
    several: bool = False

    @property
    def plain_default(self) -> Any:
        """Default as documents have it; None if there is none."""
        if self.default is REQUIRED:
            return None
        if self.domain.is_section or self.domain.kind is dict:
            return {}
        return list(self.default) if isinstance(self.default, tuple) else self.default


@cache
def parameters_of(model: type) -> dict[str, Parameter]:
    """The fields of a dataclass of parameters by name, in their order."""
    hints = get_type_hints(model, include_extras=True)
    return {each.name: _parameter(each, hints[each.name]) for each in dataclasses.fields(model)}


def _parameter(each: dataclasses.Field[Any], annotation: Any) -> Parameter:
    default = each.default
    if each.default_factory is not dataclasses.MISSING:
        default = each.default_factory()
    metadata = each.metadata
    domain = domain_of(annotation)
    meaning = metadata.get("help") or domain.meaning
    domain = replace(domain, meaning=meaning)
    metavar, read = metadata.get("metavar"), metadata.get("read")
    several = metadata.get("several", False)
    return Parameter(each.name, default, domain, meaning, annotation, metavar, read, several)


def domain_of(annotation: Any) -> ValueDomain:
    """The values that an annotation admits."""
    domain = _domain(annotation)
    return domain if domain.nullable else replace(domain, annotation=annotation)


def _domain(annotation: Any) -> ValueDomain:
    origin, parts = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return _marked(domain_of(parts[0]), parts[1:])
    if origin in (Union, types.UnionType):
        return _united([part for part in parts if part is not type(None)], type(None) in parts)
    if origin is Literal:
        return ValueDomain(str, choices=parts)
    if origin is tuple:
        endless = parts[-1] is Ellipsis
        items = tuple(map(domain_of, parts[:1] if endless else parts))
        return ValueDomain(tuple, items=items, endless=endless)
    if origin in (dict, Mapping):
        return ValueDomain(dict, items=(domain_of(parts[1]),))
    return ValueDomain(origin or annotation)


def _united(members: list[Any], nullable: bool) -> ValueDomain:
    domains = list(map(domain_of, members))
    main = next((domain for domain in domains if not domain.choices), domains[0])
    words = [word for domain in domains if domain is not main for word in domain.choices]
    return replace(
        main,
        words=tuple(words),
        nullable=nullable,
        is_union=len(domains) > 1,
        annotation=Union[tuple(members)],  # noqa: UP007
    )


def _marked(domain: ValueDomain, marks: tuple[Any, ...]) -> ValueDomain:
    limits, reasons = dict(domain.limits), dict(domain.reasons)
    for mark in marks:
        if isinstance(mark, str):
            domain = replace(domain, meaning=mark)
        elif isinstance(mark, Check) and mark.before and not mark.besides:
            domain = replace(domain, kind=str, items=())
        elif isinstance(mark, OneOf):
            domain = replace(domain, choices=mark.names)
        else:
            known = {name: getattr(mark, name, None) for name in _LIMITS}
            own = {name: value for name, value in known.items() if value is not None}
            limits |= own
            reasons |= dict.fromkeys(own, getattr(mark, "why", ""))
    return replace(domain, limits=limits, reasons=reasons)
