"""Struck objects made by code, in metres."""

from __future__ import annotations

from collections.abc import Callable

import trimesh

from carillon.errors import UserError


def bar() -> trimesh.Trimesh:
    """Metallophone bar, 240 x 36 x 24 mm."""
    return trimesh.creation.box(extents=(0.240, 0.036, 0.024))


BUILTINS: dict[str, Callable[[], trimesh.Trimesh]] = {"bar": bar}


def builtin_surface(name: str) -> trimesh.Trimesh:
    """Surface of the built-in object `name` in metres, z up.

    Raises
    ------
    UserError
        If there is no such object; the message lists the names.
    """
    if name not in BUILTINS:
        raise UserError(
            f"builtin:{name}: no such built-in object, expected one of {', '.join(BUILTINS)}"
        )
    return BUILTINS[name]()
