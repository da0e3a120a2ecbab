"""Dataclasses whose values pydantic checks.

pydantic is imported when the first value is checked, so that `--help` does not wait for it.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar, dataclass_transform

if TYPE_CHECKING:
    from pydantic import ConfigDict, GetCoreSchemaHandler, TypeAdapter
    from pydantic_core import CoreSchema

T = TypeVar("T")

REQUIRED: Any = dataclasses.MISSING
"""Default of an option that has none."""
CONFIG: ConfigDict = {"extra": "forbid", "allow_inf_nan": False, "validate_default": True}
"""pydantic's settings for all parameters: no unknown keys, finite numbers, defaults as given."""


EXACT = 2.0**53
"""Largest number below which all whole numbers are exact in double precision."""


class OneOf:
    """Marker in `Annotated[str, OneOf(*names)]` of a text that is one of several."""

    def __init__(self, *names: str) -> None:
        self.names = names

    def __get_pydantic_core_schema__(self, _: Any, __: GetCoreSchemaHandler) -> CoreSchema:
        from pydantic_core import core_schema

        return core_schema.literal_schema(list(self.names))


class Within:
    """Marker of limits: ge, gt, le and lt of numbers, min_length and max_length of texts and lists.

    `why` is the reason for them, where it does not go without saying. Those of `annotated_types`
    mean the same; to import these takes as long as `--help`.
    """

    def __init__(self, why: str = "", **limits: float) -> None:
        self.why = why
        self.limits = limits
        for name, value in limits.items():
            setattr(self, name, value)

    def __get_pydantic_core_schema__(self, source: Any, admit: GetCoreSchemaHandler) -> CoreSchema:
        schema: Any = {**admit(source), **self.limits}
        return schema  # type: ignore[no-any-return]


@dataclass(frozen=True)
class Check:
    """Marker in `Annotated[..., Check(function)]` of values that a function checks or converts.

    The function returns the value to take, and raises ValueError with the reason why there is none.
    It is given what `Annotated` admits; with `before`, what was given, which is a text, or with
    `besides`, a text or what the annotation admits; `alone`, the annotation does not count: it may
    be of arrays or functions.
    """

    function: Callable[[Any], Any]
    before: bool = False
    alone: bool = False
    besides: bool = False

    def __get_pydantic_core_schema__(self, source: Any, admit: GetCoreSchemaHandler) -> CoreSchema:
        from pydantic_core import core_schema

        if self.alone:
            return core_schema.no_info_plain_validator_function(self.function)
        if self.before:
            return core_schema.no_info_before_validator_function(self.function, admit(source))
        return core_schema.no_info_after_validator_function(self.function, admit(source))


def option(
    default: Any,
    help: str | None = None,
    *,
    metavar: str | tuple[str, ...] | None = None,
    read: Callable[[str], Any] | None = None,
    several: bool = False,
) -> Any:
    """A field of a dataclass of parameters.

    Parameters
    ----------
    default
        Its default; with `REQUIRED` it has to be given. A dataclass or another function stands for
        what it makes without arguments.
    help
        What it is, with its unit in brackets; by default what its annotation says.
    metavar
        Name of its value in the help of commands.
    read
        Makes a value from the word of a command line, where the annotation does not say how; raises
        ValueError with a reason.
    several
        Whether `read` makes an item of the value, from each of several words.
    """
    metadata = {"help": help, "metavar": metavar, "read": read, "several": several}
    if default is REQUIRED:
        return dataclasses.field(metadata=metadata)
    if callable(default):
        return dataclasses.field(default_factory=default, metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


@dataclass_transform(frozen_default=True)
def parameters(cls: type[T]) -> type[T]:
    """Make a frozen dataclass whose values are checked against their annotations.

    Numbers of NumPy become Python's, and lists become tuples; a text is no number. A check of
    several values belongs in `__post_init__`, which raises ValueError with what is wrong; then the
    sentence begins with the place of the dataclass. Raises UserError on construction, with one
    sentence about the first value that is not admitted.
    """
    made: Any = dataclass(frozen=True)(cls)
    names = [field.name for field in dataclasses.fields(made)]

    @functools.wraps(made.__init__)
    def construct(self: Any, *values: Any, **named: Any) -> None:
        from pydantic import ValidationError
        from pydantic_core import ArgsKwargs

        from carillon.parameters.fields import ValueDomain
        from carillon.parameters.sentences import mistake_of

        if len(values) > len(names):
            raise TypeError(f"{made.__name__} takes {len(names)} values, {len(values)} are given")
        given = {name: _plain(value) for name, value in (*zip(names, values), *named.items())}
        try:
            validate = adapter(made).validator.validate_python
            validate(ArgsKwargs((), given), strict=True, self_instance=self)
        except ValidationError as error:
            raise mistake_of(error, ValueDomain(made)) from None

    made.__init__ = construct
    made.__pydantic_config__ = CONFIG
    return made


def _plain(value: Any) -> Any:
    """NumPy's numbers as Python's, lists as tuples, and floats that are whole as whole numbers."""
    value = value.item() if getattr(value, "shape", None) == () else value
    if isinstance(value, list | tuple):
        return tuple(map(_plain, value))
    if isinstance(value, dict):
        return {key: _plain(each) for key, each in value.items()}
    is_whole = isinstance(value, float) and value.is_integer() and abs(value) < EXACT
    return int(value) if is_whole else value


def checked(name: str, value: Any, annotation: Any) -> Any:
    """A value of a call, if an annotation such as `Resolution` admits it, as `parameters` takes it.

    Raises UserError if it does not, with a sentence that begins with `name`.
    """
    from pydantic import ValidationError

    from carillon.parameters.fields import domain_of
    from carillon.parameters.sentences import ParameterError, mistake_of

    try:
        return adapter(annotation).validate_python(_plain(value), strict=True)
    except ValidationError as error:
        mistake = mistake_of(error, domain_of(annotation))
        raise ParameterError((name, *mistake.place), mistake.reason, mistake.meaning) from None


@functools.cache
def adapter(annotation: Any) -> TypeAdapter[Any]:
    """pydantic's validator of a dataclass of parameters or of one annotation."""
    from pydantic import TypeAdapter

    is_model = hasattr(annotation, "__pydantic_config__")
    return TypeAdapter(annotation, config=None if is_model else CONFIG)
