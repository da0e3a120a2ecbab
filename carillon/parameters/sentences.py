"""Mistakes in parameters, each told in one sentence: its place, what was found and expected."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any

from carillon.errors import UserError
from carillon.parameters.fields import ValueDomain, parameters_of

if TYPE_CHECKING:
    from pydantic import ValidationError

_KINDS = {
    int: "a whole number",
    float: "a number",
    str: "a text",
    bool: "true or false",
    tuple: "a list",
}
_RULES = {
    "greater_than_equal": "at least {ge}",
    "greater_than": "above {gt}",
    "less_than_equal": "at most {le}",
    "less_than": "below {lt}",
    "too_short": "at least {min_length} of them",
    "too_long": "at most {max_length} of them",
    "string_too_short": "a text",
    "string_too_long": "at most {max_length} characters",
    "finite_number": "a finite number",
}
_BOUNDS = {
    "greater_than_equal": "ge",
    "greater_than": "gt",
    "less_than_equal": "le",
    "less_than": "lt",
}
_LIMITS = ("ge", "gt", "le", "lt", "min_length", "max_length")
_UNKNOWN = ("unexpected_keyword_argument", "extra_forbidden")

ALIKE = 0.7
"""Share of letters in common (difflib) from which a word is taken for a mistyped one."""

Place = tuple[str | int, ...]

_OPTION = re.compile(r"--([a-z][a-z-]*[a-z])(?: ([^\s(),;]+))?")


def in_keys(sentence: str) -> str:
    """A sentence about options of commands, with the keys of a file in their place.

    A word that comes after an option, without a comma, is its value.

    Examples
    --------
    >>> in_keys("keep the largest alone (--components largest), or make a wall (--wall)")
    'keep the largest alone (components: largest), or make a wall (wall)'
    """

    def key(option: re.Match[str]) -> str:
        name = option[1].replace("-", "_")
        return name if option[2] is None else f"{name}: {option[2]}"

    return _OPTION.sub(key, sentence)


class ParameterError(UserError):
    """A value that a parameter does not take.

    Attributes
    ----------
    place
        Keys and numbers that lead to it in its document.
    reason
        What is wrong with it, without its place and meaning.
    meaning
        What the parameter is.
    """

    def __init__(
        self, place: Place, reason: str, meaning: str = "", names: Sequence[str] = ()
    ) -> None:
        where = in_words(place) + (f" ({', '.join(names)})" if names else "")
        super().__init__(": ".join(part for part in (where, reason, meaning) if part))
        self.place = self._told = place
        self.reason = reason
        self.meaning = meaning

    def named_in(self, document: Any) -> ParameterError:
        """The same, with the names that items of lists have in the document; see `names_along`."""
        if self.place[-1:] == ("name",):  # The reason tells it.
            return self
        names = names_along(document, self.place)
        named = ParameterError(self._told, self.reason, self.meaning, names)
        named.place = self.place
        return named

    def __reduce__(self) -> tuple[Any, ...]:
        # Ranks and processes send the sentence.
        return UserError, self.args, vars(self)


def mistake_of(
    error: ValidationError, domain: ValueDomain, in_yaml: bool = False
) -> ParameterError:
    """The first mistake that pydantic found in values that should have a domain.

    A mistyped key often is also one that is missed: the former says more and goes first. What was
    found is shown in the words of Python or of YAML.
    """
    mistakes = error.errors(include_url=False)
    mistakes.sort(key=lambda mistake: mistake["type"] not in _UNKNOWN)
    mistake = mistakes[0]
    kind, value = mistake["type"], mistake.get("input")
    place, domain, parent = _followed(mistake["loc"], domain)
    shown = _in_yaml(value, domain) if in_yaml else _shown(value)
    if kind in _UNKNOWN:
        unknown = no_key(str(place[-1]), list(parameters_of(parent.kind)))
        mistyped = ParameterError(place[:-1], unknown)
        mistyped.place = place  # Of the line, which names the key.
        return mistyped
    if kind == "missing" and parent.kind is tuple:
        reason = f"found {shown}, expected {len(parent.items)} of them"
        return ParameterError(place[:-1], reason, parent.meaning)
    if kind == "missing":
        reason = f"the key {place[-1]} is missing, expected {domain.meaning}"
        return ParameterError(place[:-1], reason)
    if kind in ("value_error", "assertion_error"):
        return ParameterError(place, str(mistake["ctx"]["error"]))
    reason = f"found {shown}, expected {_expected(kind, mistake.get('ctx', {}), domain)}"
    if isinstance(value, str):
        reason += did_you_mean(value, [*domain.choices, *domain.words])
    return ParameterError(place, reason, domain.meaning)


def in_words(place: Iterable[str | int]) -> str:
    """Name of a value.

    Examples
    --------
    >>> in_words(("targets", 0, "clip"))
    'targets[0].clip'
    """
    parts = [f"[{part}]" if isinstance(part, int) else f".{part}" for part in place]
    return "".join(parts).removeprefix(".")


def names_along(document: Any, place: Iterable[str | int]) -> list[str]:
    """Names of the items of lists along a place in a document, the outermost one first.

    Examples
    --------
    >>> names_along({"objects": [{"name": "bowl", "radius": -1}]}, ("objects", 0, "radius"))
    ['bowl']
    """
    names = []
    for part in place:
        try:
            document = document[part]
        except (LookupError, TypeError):
            break
        if isinstance(part, int) and isinstance(document, Mapping):
            name = document.get("name")
            names += [name] if isinstance(name, str) and name else []
    return names


def _followed(
    location: Sequence[str | int], domain: ValueDomain
) -> tuple[Place, ValueDomain, ValueDomain]:
    """Place of a mistake, the domain that is expected there, and the one around it."""
    place: list[str | int] = []
    parent = domain
    tried = False
    for part in location:
        if domain.is_union and not tried:
            tried = True  # Names the member of the union that pydantic tried.
            continue
        tried = False
        place.append(part)
        parent = domain
        if domain.is_section:
            known = parameters_of(domain.kind)
            domain = known[str(part)].domain if part in known else ValueDomain(Any)
        elif domain.items:
            number = part if isinstance(part, int) and not domain.endless else 0
            domain = domain.items[min(number, len(domain.items) - 1)]
        else:
            domain = ValueDomain(Any)
    return tuple(place), domain, parent


def no_key(name: str, known: list[str]) -> str:
    """Reason for refusing a key that is not among the known ones."""
    suggestion = alike(name, known)
    hint = f"; did you mean {suggestion}?" if suggestion else ""
    only = f", only {', '.join(known)}" if known else ""
    return f"there is no key {name!r:.100}{only}{hint}"


def _expected(kind: str, context: dict[str, Any], domain: ValueDomain) -> str:
    if kind in _RULES:
        bound = _RULES[kind].format(
            **{key: _limit(value) for key, value in context.items() if key in _LIMITS}
        )
        if "than" in kind and domain.unit:
            bound += f" {domain.unit}"
        bound += f", or {' or '.join(domain.words)}" if domain.words else ""
        why = domain.reasons.get(_BOUNDS.get(kind, ""))
        return f"{bound}, since {why}" if why else bound
    if domain.choices:
        return f"one of {', '.join(domain.choices)}"
    named = [_KINDS.get(domain.kind, "keys and values"), *domain.words, *["null"] * domain.nullable]
    return " or ".join(named)


def _limit(value: Any) -> str:
    if isinstance(value, str):
        return value
    return f"{value:g}" if isinstance(value, float) else f"{value:,}"


def _shown(value: Any) -> str:
    return f"{list(value) if isinstance(value, tuple) else value!r:.200}"


def alike(word: str, words: Iterable[str]) -> str | None:
    """The one of `words` that a mistyped word is most like, if it is like any.

    Examples
    --------
    >>> alike("Validte", ["modes", "validate"]), alike("ring", ["modes", "validate"])
    ('validate', None)
    """
    lower = {each.lower(): each for each in words}
    close = get_close_matches(word.lower(), list(lower), 1, ALIKE)
    return lower[close[0]] if close else None


def did_you_mean(word: str, words: Iterable[str]) -> str:
    """Hint at what a mistyped word should be, in brackets after a blank; empty if there is none."""
    meant = alike(word, words)
    return f" (did you mean {meant}?)" if meant else ""


def _in_yaml(value: Any, domain: ValueDomain) -> str:
    if value is None:
        return "nothing"
    if not isinstance(value, bool):
        return _shown(value)
    words = "true, as YAML reads yes and on" if value else "false, as YAML reads no and off"
    return f"{words} without quotes" if domain.kind is str else words.partition(",")[0]
