"""Names of the built-in solids; to know them takes none of what makes their surfaces."""

from pathlib import Path

BUILTIN_PREFIX = "builtin:"
"""Prefix of a built-in solid's name where a mesh is asked for."""
THICK = ("bar", "bell", "bowl", "box", "frying-pan", "pitcher", "plate", "snare-drum")
"""Solids that `carillon.fem.geometry.builtin` makes."""
THIN = ("cymbal", "handbell", "rin", "skillet", "wine-glass")
"""Thin-walled solids that `carillon.fem.geometry.builtin` makes."""
TRIALS = ("comb", "cup", "dumbbell", "eared-head", "fork", "slit-ring", "spiral", "stool")
"""Trial solids that `carillon.fem.geometry.builtin` makes."""
BUILTIN_NAMES = (*THICK, *THIN, *TRIALS)


def in_folder(name: str, folder: Path) -> str:
    """Path of a file that is named relative to a folder; names of built-in solids stay.

    Examples
    --------
    >>> in_folder("bar.obj", Path("meshes")), in_folder("builtin:bar", Path("meshes"))
    ('meshes/bar.obj', 'builtin:bar')
    """
    return name if name.startswith(BUILTIN_PREFIX) else str(folder / name)
