"""How large a mesh and its voxels are, in words, and whether its unit looks wrong."""

from collections.abc import Sequence

from carillon.command_line.logs import warn_once

LARGE = 3.0
"""Longest side [m] from which a mesh may be in millimetres: of what is struck, most is smaller."""
SMALL = 3e-3
"""Longest side [m] up to which a mesh that is taken for one in millimetres may be in metres."""


def sizes_in_words(mesh: Sequence[float], voxels: Sequence[float] | None) -> str:
    """Sides of the boxes around a mesh and around the voxels that stand for it [m].

    Finite cells take the solid as it is, and have no voxels (None).

    Examples
    --------
    >>> sizes_in_words([0.4, 0.1, 0.05], [0.4, 0.12, 0.04])
    'mesh 0.4 x 0.1 x 0.05 m, voxels 0.4 x 0.12 x 0.04 m'
    >>> sizes_in_words([0.4, 0.1, 0.05], None)
    'mesh 0.4 x 0.1 x 0.05 m'
    """
    beside = "" if voxels is None else f", voxels {_in_words(voxels)}"
    return f"mesh {_in_words(mesh)}{beside}"


def _in_words(extents: Sequence[float]) -> str:
    return f"{' x '.join(f'{side:.4g}' for side in extents)} m"


def doubt_unit(mesh: str, extents: Sequence[float], unit: float) -> None:
    """Log what `unit_hint` says of a mesh file, once; built-in objects are in metres.

    For those who have made a solid of it: what is refused is told alone.
    """
    if not mesh.startswith("builtin:") and (hint := unit_hint(extents, unit)):
        warn_once(f"{mesh}: {hint}")


def unit_hint(extents: Sequence[float], unit: float) -> str | None:
    """What to say of sides [m] that a mistaken unit would make.

    `unit`: metres per unit of the mesh, as it was given.

    Examples
    --------
    >>> unit_hint([400.0, 100.0, 100.0], 1.0)
    'it measures 400 x 100 x 100 m; if its coordinates are millimetres, give --unit 0.001'
    >>> unit_hint([0.0004, 0.0001, 0.0001], 0.001)
    'it measures 0.0004 x 0.0001 x 0.0001 m; if its coordinates are metres, give --unit 1'
    """
    longest, measures = max(extents), f"it measures {_in_words(extents)}"
    if unit == 1.0 and longest >= LARGE:
        return f"{measures}; if its coordinates are millimetres, give --unit 0.001"
    if unit < 1.0 and longest <= SMALL and longest / unit < LARGE:
        return f"{measures}; if its coordinates are metres, give --unit 1"
    return None
