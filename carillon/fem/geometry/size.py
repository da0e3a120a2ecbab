"""How large a mesh and its voxels are, in words, and whether its unit looks wrong."""

from collections.abc import Sequence

from carillon.parameters.quantities import LENGTHS

LARGE = 3.0
"""Longest side [m] from which the unit of a mesh may be another: of what is struck, most is
smaller."""
SMALL = 3e-3
"""Longest side [m] up to which a mesh that is taken for one in smaller units may be in metres."""
INAUDIBLE = 50.0
"""Longest side [m] from which the lowest modes of any solid are below hearing."""
USUAL = (0.02, LARGE)
"""Longest sides [m] of most things that are struck."""
NAMES = {"m": "metres", "cm": "centimetres", "mm": "millimetres", "in": "inches"}
"""Units that meshes are made in."""
_SHOWN = (("m", 1.0), ("cm", 0.01), ("mm", 1e-5), ("um", 0.0))
"""Units of lengths in sentences, and the least longest side [m] that is told in each."""


def sizes_in_words(mesh: Sequence[float], voxels: Sequence[float] | None) -> str:
    """Sides of the boxes around a mesh and around the voxels that stand for it [m].

    Finite cells take the solid as it is, and have no voxels (None).

    Examples
    --------
    >>> sizes_in_words([0.4, 0.1, 0.05], [0.4, 0.12, 0.04])
    'mesh 40 x 10 x 5 cm, voxels 40 x 12 x 4 cm'
    >>> sizes_in_words([0.4, 0.1, 0.05], None)
    'mesh 40 x 10 x 5 cm'
    """
    beside = "" if voxels is None else f", voxels {lengths_in_words(voxels)}"
    return f"mesh {lengths_in_words(mesh)}{beside}"


def lengths_in_words(lengths: Sequence[float]) -> str:
    """Lengths [m], as of the sides of a box, in the unit that suits the longest of them.

    Examples
    --------
    >>> lengths_in_words([0.4, 0.1, 0.0005]), lengths_in_words([0.0021])
    ('40 x 10 x 0.05 cm', '2.1 mm')
    """
    unit = _unit_of(max(lengths))
    return f"{' x '.join(f'{side / LENGTHS[unit]:.4g}' for side in lengths)} {unit}"


def length_in_words(length: float) -> str:
    """A length [m] in the unit that suits it, to three digits.

    Examples
    --------
    >>> length_in_words(0.00127), length_in_words(12.345)
    ('1.27 mm', '12.3 m')
    """
    unit = _unit_of(length)
    return f"{length / LENGTHS[unit]:.3g} {unit}"


def _unit_of(length: float) -> str:
    return next((name for name, least in _SHOWN if length >= least), "m")


def unit_hint(extents: Sequence[float], unit: float) -> str | None:
    """What to say of sides [m] that a mistaken unit would make; None if they are usual ones.

    `unit`: metres per unit of the mesh, as it was given.

    Examples
    --------
    >>> unit_hint([400.0, 100.0, 100.0], 1.0)
    'it is 400 m long, its lowest modes are below hearing; in millimetres (--unit mm) it is 40 cm'
    >>> unit_hint([0.0004, 0.0001, 0.0001], 0.001)
    'it is 0.4 mm long; in metres (--unit m) it is 40 cm'
    """
    others = likely_units(extents, unit)
    if not others:
        return None
    longest = max(extents)
    heard = ", its lowest modes are below hearing" if longest >= INAUDIBLE else ""
    as_others = " and ".join(
        f"in {NAMES[name]} (--unit {name}) it is {lengths_in_words([longest / unit * metres])}"
        for name, metres in others.items()
    )
    return f"it is {lengths_in_words([longest])} long{heard}; {as_others}"


def likely_units(extents: Sequence[float], unit: float) -> dict[str, float]:
    """Other units that a mesh may be in, as metres by their names, the likeliest first.

    None at all if its sides [m] are usual ones. `unit`: metres per unit of the mesh, as it was
    given.

    Examples
    --------
    >>> likely_units([6.4, 3.1, 4.0], 1.0)
    {'cm': 0.01, 'in': 0.0254}
    >>> likely_units([0.4, 0.1, 0.1], 1.0)
    {}
    """
    longest = max(extents)
    if unit == 1.0 and longest >= LARGE:
        names = ["mm", "cm", "in"]
    elif unit < 1.0 and longest <= SMALL and longest / unit < LARGE:
        names = ["m"]
    else:
        return {}
    fitting = [
        name for name in names if USUAL[0] <= longest / unit * LENGTHS[name] <= USUAL[1]
    ] or names[:1]
    return {name: LENGTHS[name] for name in fitting}
