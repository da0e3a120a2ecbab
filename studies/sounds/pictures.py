"""The material on the solid, with the places that are struck."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from carillon.arrays import Array
from carillon.drawing.solid import guess_up, looks_at, view_of
from carillon.fem.geometry import HexMesh, hexmesh_from_grid
from sound.project.design import Design
from studies.base.colours import COLOURS
from studies.base.media import COLOUR_MAP, Pixels, cropped, marked_picture
from studies.sounds.plots import limits

POINT_CLASSES = ("random", "hcms_ec", "ddfem_slepc", "ddfem_hcms_ec")
"""Styles of the struck points, in turn."""
ELSEWHERE_CLASS = "hcms"
BEHIND = -0.35
"""Cosine between the surface's normal and the direction of the eye up to which a mark is hidden."""


@dataclass(frozen=True)
class Mark:
    """An arrow of the colour `style` to a point (3,) [m] along a direction into the solid."""

    style: str
    position: Array
    inward: Array


def marks_of(design: Design) -> list[Mark]:
    """Marks of a design's struck points."""
    return [
        Mark(POINT_CLASSES[number % len(POINT_CLASSES)], strike.position, strike.inward)
        for number, strike in enumerate(design.strikes)
    ]


def material_pictures(design: Design, marks: Sequence[Mark]) -> list[Pixels]:
    """Voxels in the colours of their moduli, from where most marks are seen and from behind."""
    mesh = fine_mesh(design)
    up = guess_up(mesh)
    outward = -np.array([each.inward for each in marks])
    elevation, azimuth = view_of(mesh, outward, up)
    low, high = np.log10(limits(design.young))
    look: Any = {"values": np.log10(design.young), "cmap": COLOUR_MAP, "limits": (low, high)}

    def picture(view: tuple[float, float]) -> Pixels:
        seen = np.flatnonzero(looks_at(mesh, outward, view, up) > BEHIND)
        arrows = [(marks[i].position, COLOURS[marks[i].style], marks[i].inward) for i in seen]
        return marked_picture(mesh, arrows, up=up, view=view, **look)

    return cropped([picture((elevation, azimuth + turn)) for turn in (0.0, 180.0)])


def fine_mesh(design: Design) -> HexMesh:
    """The voxels of a design."""
    return hexmesh_from_grid(design.fine_grid, design.fine_origin, design.fine_edge)
