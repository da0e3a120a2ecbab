"""Pictures of the solid: its surface, its voxels, its material, and where it is struck."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from carillon.fem.geometry import HexMesh
from carillon.fem.geometry.picture import draw, draw_surface, guess_up, view_of
from solver.response.contact import Contact
from workflow.studies.base.colours import COLOURS
from workflow.studies.base.media import COLOUR_MAP, Pixels, cropped, marked_picture, solid_picture

Array = NDArray[np.float64]

STRUCK, OBSERVED = COLOURS["random"], COLOURS["hcms_ec"]
"""Colours of the marks."""


def solid_pictures(surface: trimesh.Trimesh, mesh: HexMesh, young: Array) -> list[Pixels]:
    """The surface, the voxels, and the voxels coloured by log10 of their moduli (m,) [Pa]."""
    up = guess_up(mesh)
    vertices, faces = surface.vertices, surface.faces
    drawn: list[Callable[[Any], Any]] = [
        partial(draw_surface, vertices=vertices, faces=faces, mesh=mesh, up=up),
        partial(draw, mesh=mesh, up=up),
        partial(draw, mesh=mesh, values=np.log10(young), up=up, cmap=COLOUR_MAP),
    ]
    return cropped(list(map(solid_picture, drawn)))


def struck_picture(mesh: HexMesh, strike: Contact, observed: Contact) -> Pixels:
    """The voxels with an arrow where they are struck and a ring where they are watched."""
    up = guess_up(mesh)
    view = view_of(mesh, -np.array([strike.inward, observed.inward]), up)
    marks = [(strike.position, STRUCK, strike.inward), (observed.position, OBSERVED, None)]
    return cropped([marked_picture(mesh, marks, up=up, view=view)])[0]
