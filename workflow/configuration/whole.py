"""The whole configuration: the main chain's sections, and those that studies add."""

from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import cache
from importlib import import_module
from typing import Any

from carillon.parameters import option, parameters
from carillon.parameters.documents import parameters_from
from carillon.parameters.sentences import ParameterError, Place, alike
from workflow.configuration.resources import LIMITS, JobLimits
from workflow.configuration.run import Configuration

Values = Mapping[str, Any]


@cache
def whole() -> type[Configuration]:
    """The configuration with the sections of all studies that there are."""
    sections: dict[str, type] = {}
    for each in import_module("studies").configurations():
        sections |= getattr(each, "SECTIONS", {})
    defaults = {name: option(section) for name, section in sections.items()}
    namespace = {"__annotations__": sections, "__module__": __name__, **defaults}
    return parameters(type("WholeConfiguration", (Configuration,), namespace))


@cache
def limits() -> dict[str, JobLimits]:
    """What jobs of all rules may take, by rule."""
    known = dict(LIMITS)
    for each in import_module("studies").configurations():
        known |= getattr(each, "LIMITS", {})
    return known


def completed(values: Values) -> dict[str, Any]:
    """A configuration with its defaults, from what is given.

    Raises ParameterError with one sentence about the first value that does not fit.
    """
    run = parameters_from(values, whole())
    _check_in(run, run, ())
    for rule in run.resources:
        if rule not in limits():
            meant = alike(rule, limits())
            hint = f"; did you mean {meant}?" if meant else ""
            raise ParameterError(("resources",), f"no rule {rule!r} takes any{hint}")
    config: dict[str, Any] = _as_given(run, values)
    config["resources"] = {
        rule: _limits_of(own, config["resources"].get(rule, {})) for rule, own in limits().items()
    }
    return config


def _limits_of(own: JobLimits, given: Values) -> dict[str, Any]:
    asked = {key: value for key, value in given.items() if value is not None}
    return {"memory_mb": own.memory_mb, "minutes": own.minutes} | asked


def _check_in(part: Any, run: Configuration, place: Place) -> None:
    """Have all sections checked that depend on several values."""
    try:
        if hasattr(part, "check_in"):
            part.check_in(run)
    except ParameterError as error:
        raise ParameterError((*place, *error.place), error.reason) from None
    for field in fields(part):
        value = getattr(part, field.name)
        if is_dataclass(value):
            _check_in(value, run, (*place, field.name))


def _as_given(made: Any, given: Any) -> Any:
    """Plain values; numbers without a point stay such, so that equal files have equal hashes."""
    if is_dataclass(made):
        made = {field.name: getattr(made, field.name) for field in fields(made)}
    if isinstance(made, Mapping):
        given = given if isinstance(given, Mapping) else {}
        return {key: _as_given(value, given.get(key)) for key, value in made.items()}
    if isinstance(made, tuple):
        given = given if isinstance(given, Sequence) else [None] * len(made)
        return [_as_given(*pair) for pair in zip(made, given, strict=True)]
    return given if isinstance(given, int) and isinstance(made, float) else made
