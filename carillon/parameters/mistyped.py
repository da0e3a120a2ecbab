"""Words that were meant by mistyped ones."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

ALIKE = 0.7
"""Share of letters in common (difflib) from which a word is taken for a mistyped one."""


def alike(word: str, words: Iterable[str]) -> str | None:
    """The one of `words` that a mistyped word is most like, if it is like any.

    Examples
    --------
    >>> alike("Validte", ["modes", "validate"]), alike("ring", ["modes", "validate"])
    ('validate', None)
    """
    lower = {each.lower(): each for each in words}
    found = get_close_matches(word.lower(), list(lower), 1, ALIKE)
    return lower[found[0]] if found else None
