"""Names of the built-in solids; to know them takes none of what makes their surfaces."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

Made = TypeVar("Made")

BUILTIN_PREFIX = "builtin:"
"""Prefix of a built-in solid's name where a mesh is asked for."""
THICK = ("bar", "bell", "bowl", "box", "frying-pan", "pitcher", "plate", "snare-drum")
"""Solids that `carillon.fem.geometry.builtin` makes."""
THIN = ("cymbal", "handbell", "rin", "skillet", "wine-glass")
"""Thin-walled solids that `carillon.fem.geometry.thin` makes."""
TRIALS = ("comb", "cup", "dumbbell", "eared-head", "fork", "slit-ring", "spiral", "stool")
"""Trial solids that `carillon.fem.geometry.trials` makes."""
BUILTIN_NAMES = (*THICK, *THIN, *TRIALS)


def named(names: Sequence[str], *functions: Callable[[], Made]) -> dict[str, Callable[[], Made]]:
    """The functions by the names, which are theirs with hyphens.

    Raises
    ------
    ValueError
        If a name is not that of the function.

    Examples
    --------
    >>> def wine_glass(): return "a glass"
    >>> named(["wine-glass"], wine_glass)["wine-glass"]()
    'a glass'
    """
    found = {function.__name__.replace("_", "-"): function for function in functions}
    if list(found) != list(names):
        raise ValueError(f"functions {', '.join(found)}, expected {', '.join(names)}")
    return found
