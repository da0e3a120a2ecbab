"""The solids of the study: thin walls, thick ones beside them, and files that users name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from carillon.arrays import Surface
from carillon.fem.geometry import load_surface
from carillon.fem.geometry.builtin import builtin_surface
from carillon.fem.geometry.sweep import joined
from studies.accuracy.solids import ANGLES
from studies.thin_walls import profiles
from studies.thin_walls.profiles import SECTIONS, Profile, profile_of
from studies.thin_walls.tetrahedra import Part

Kind = Literal["thin", "thick", "file"]
STRAIGHT, TURNED = "straight", "turned"
"""Positions against the lattice."""


@dataclass(frozen=True)
class WalledSolid:
    """A solid of the study."""

    title: str
    """Name for people."""
    kind: Kind
    make: Callable[[], Surface | Profile]
    """Makes the surface as users have it, or the polygon that it is turned from."""
    wall: float
    """Thickness of its thinnest walls [m]; 0 if it is not known."""

    def parts(self) -> list[Part]:
        """Closed parts, which may overlap; polygons where they are turned about z."""
        made = self.make()
        if isinstance(made, Profile):
            return [made]
        split = made.split(only_watertight=False)
        return [profile_of(part) or part for part in split]

    def surface(self, position: str = STRAIGHT, sections: int = SECTIONS) -> Surface:
        """Triangles [m], with so many sections of what is turned; `turned` is by `ANGLES`."""
        from trimesh.transformations import euler_matrix

        if self.kind == "file":
            made = self.make()
            assert not isinstance(made, Profile)
        else:
            parts = self.parts()
            made = joined(*(p.surface(sections) if isinstance(p, Profile) else p for p in parts))
        if position == TURNED:
            made = made.copy().apply_transform(euler_matrix(*np.radians(ANGLES)))
        return made

    @property
    def profile(self) -> Profile | None:
        """The polygon of a solid of revolution; None of others."""
        if self.kind == "file":
            return None
        parts = self.parts()
        return parts[0] if len(parts) == 1 and isinstance(parts[0], Profile) else None


def _builtin(title: str, kind: Kind, name: str, wall: float) -> WalledSolid:
    return WalledSolid(title, kind, lambda: builtin_surface(name), wall)


def _plate(side: float, wall: float) -> Surface:
    from trimesh.creation import box

    return box(extents=(side, side, wall))


SIDE = 0.2
"""Width of the plates [m]."""

SOLIDS = {
    "wine-glass": _builtin("Wine glass", "thin", "wine-glass", 0.0012),
    "skillet": _builtin("Skillet", "thin", "skillet", 0.004),
    "cymbal": _builtin("Cymbal", "thin", "cymbal", 0.0012),
    "handbell": _builtin("Handbell", "thin", "handbell", 0.003),
    "rin": _builtin("Rin", "thin", "rin", 0.0025),
    "hemisphere": WalledSolid("Hemisphere, wall 1/200", "thin", profiles.hemisphere, 0.001),
    "ring": WalledSolid("Ring, wall 1/200", "thin", profiles.ring, 0.001),
    "disc-200": WalledSolid("Disc, 1/200", "thin", profiles.disc, 0.001),
    "disc-500": WalledSolid("Disc, 1/500", "thin", lambda: profiles.disc(wall=0.0004), 0.0004),
    "plate-200": WalledSolid("Square plate, 1/200", "thin", lambda: _plate(SIDE, 0.001), 0.001),
    "plate-500": WalledSolid("Square plate, 1/500", "thin", lambda: _plate(SIDE, 4e-4), 4e-4),
    "bowl": _builtin("Bowl", "thin", "bowl", 0.010),
    "frying-pan": _builtin("Frying pan", "thin", "frying-pan", 0.017),
    "snare-drum": _builtin("Snare drum", "thin", "snare-drum", 0.024),
    "plate": _builtin("Stoneware plate", "thick", "plate", 0.015),
    "bar": _builtin("Bar", "thick", "bar", 0.015),
    "bell": _builtin("Bell", "thick", "bell", 0.012),
    "box": _builtin("Box", "thick", "box", 0.1),
    "dumbbell": WalledSolid("Dumbbell", "thick", profiles.dumbbell, 0.021),
    "fork": _builtin("Fork", "thick", "fork", 0.02),
    "slit-ring": _builtin("Slit ring", "thick", "slit-ring", 0.035),
}
"""By name; those that are named as a built-in solid have its shape."""


def solid_of_file(name: str, path: str) -> WalledSolid:
    """The solid in a mesh file; UserError if it is no use."""
    surface = load_surface(path)
    return WalledSolid(name.replace("-", " ").capitalize(), "file", lambda: surface, 0.0)
