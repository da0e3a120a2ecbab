"""Dataclasses of parameters from the keys and values of YAML files."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from carillon.errors import UserError
from carillon.files.yaml_input import DEEPEST, line_of, read_marked
from carillon.parameters.fields import ValueDomain, parameters_of
from carillon.parameters.model import EXACT, adapter
from carillon.parameters.sentences import ParameterError, Place, mistake_of, no_key

T = TypeVar("T")

MOST_BITS = 4096
"""Length of a whole number; Python does not write out those of thousands of digits."""


def read_parameters(path: str | Path, model: type[T], what: str) -> T:
    """Read a YAML file.

    Raises UserError if the file cannot be read (see `carillon.files.yaml_input.read_marked`), or
    with the line and one sentence about the first thing that is wrong with it.

    Parameters
    ----------
    model
        Dataclass of parameters that it describes.
    what
        What the file should be, for messages: "a project".
    """
    document, node = read_marked(path, what)
    try:
        return parameters_from(document, model)
    except ParameterError as error:
        raise UserError(f"{path}, line {line_of(node, error.place)}: {error}") from None
    except UserError as error:
        raise UserError(f"{path}: {error}") from None


def parameters_from(document: Mapping[str, Any], model: type[T]) -> T:
    """Parameters from plain keys and values, as YAML and JSON have them.

    Nothing is converted but numbers such as 30.0, which are whole ones, and whole ones where others
    are expected. Raises ParameterError with one sentence about the first thing that is wrong.
    """
    from pydantic import ValidationError

    text = json.dumps(_plain(document, ()))
    try:
        made: T = adapter(model).validate_json(text, strict=True)  # type: ignore[arg-type]
    except ValidationError as error:
        mistake = mistake_of(error, ValueDomain(model), in_yaml=True)
        raise mistake.named_in(document) from None
    except ParameterError as error:
        raise error.named_in(document) from None
    return made


def require_values(document: Mapping[str, Any], model: type, leave_out: Sequence[str] = ()) -> None:
    """Check some of the keys of a document, each by itself.

    Raises ParameterError with one sentence about the first that is unknown or `leave_out`, or whose
    value is wrong.
    """
    from pydantic import ValidationError

    known = {name: each for name, each in parameters_of(model).items() if name not in leave_out}
    for name, value in document.items():
        if name not in known:
            raise ParameterError((), no_key(str(name), list(known)))
        text = json.dumps(_plain(value, (name,)))
        try:
            adapter(known[name].annotation).validate_json(text, strict=True)
        except ValidationError as error:
            mistake = mistake_of(error, known[name].domain, in_yaml=True)
            raise ParameterError((name, *mistake.place), mistake.reason, mistake.meaning) from None


def document_of(parameters: Any) -> dict[str, Any]:
    """Plain keys and values of parameters, as YAML and JSON have them."""
    model: Any = type(parameters)
    plain: dict[str, Any] = adapter(model).dump_python(parameters, mode="json")
    return plain


def with_defaults(document: Mapping[str, Any], model: type) -> dict[str, Any]:
    """Keys and values with the defaults of those that are left out; None where there is none."""
    result = {}
    for name, each in parameters_of(model).items():
        if each.domain.is_section:
            result[name] = with_defaults(document.get(name) or {}, each.domain.kind)
        else:
            result[name] = document.get(name, each.plain_default)
    return result


def _plain(value: Any, place: Place) -> Any:
    """The value with whole numbers for floats that are such, fit to be written as JSON."""
    if len(place) > DEEPEST:
        raise ParameterError(place[:1], f"nested deeper than {DEEPEST} levels")
    if isinstance(value, Mapping):
        for key in value:
            if not isinstance(key, str):
                shown = repr(_plain(key, place))
                raise ParameterError(place, f"found the key {shown}, expected a text")
        return {key: _plain(each, (*place, key)) for key, each in value.items()}
    if isinstance(value, str) and any("\ud800" <= character <= "\udfff" for character in value):
        raise ParameterError(place, f"found {value!r}, which has half a character")
    if isinstance(value, list | tuple):
        return [_plain(each, (*place, number)) for number, each in enumerate(value)]
    if isinstance(value, int) and value.bit_length() > MOST_BITS:
        reason = f"found a whole number of {value.bit_length():,} bits, expected {MOST_BITS:,}"
        raise ParameterError(place, f"{reason} at most")
    if isinstance(value, float) and value.is_integer() and abs(value) < EXACT:
        return int(value)
    if value is not None and not isinstance(value, str | int | float):
        raise ParameterError(place, f"found {value!r}, expected a text, a number, a list or keys")
    return value
