"""Pictures of the solid: its surface, its voxels, its material, and where it is struck."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from carillon.drawing.solid import Skin, draw, guess_up, view_of
from carillon.fem.geometry import HexMesh
from solver.response.contact import Contact
from studies.base.colours import COLOURS
from studies.base.media import COLOUR_MAP, Pixels, cropped, marked_picture, solid_picture

Array = NDArray[np.float64]

STRUCK, OBSERVED = COLOURS["random"], COLOURS["hcms_ec"]
"""Colours of the marks."""
SHARES = "YlOrBr"
"""Colours of what is inside, from none to all."""


def solid_pictures(
    surface: trimesh.Trimesh,
    mesh: HexMesh,
    young: Array,
    share: Array | None = None,
    skin: Skin | None = None,
) -> list[Pixels]:
    """The surface, the voxels, and the voxels coloured by log10 of their moduli (m,) [Pa].

    Those of finite cells are coloured by the `share` (m,) of them that is inside, and their `skin`
    by the moduli.
    """
    up = guess_up(mesh)
    given = Skin(np.asarray(surface.vertices), np.asarray(surface.faces))
    drawn: list[Callable[[Any], Any]] = [
        partial(draw, mesh=mesh, up=up, skin=given),
        partial(draw, mesh=mesh, values=share, up=up, cmap=SHARES, limits=(0.0, 1.0)),
        partial(draw, mesh=mesh, values=np.log10(young), up=up, cmap=COLOUR_MAP, skin=skin),
    ]
    return cropped(list(map(solid_picture, drawn)))


def struck_picture(mesh: HexMesh, strike: Contact, observed: Contact, skin: Skin | None) -> Pixels:
    """Voxels, or finite cells' skin, with an arrow where it is struck and a ring where watched."""
    up = guess_up(mesh)
    view = view_of(mesh, -np.array([strike.inward, observed.inward]), up)
    marks = [(strike.position, STRUCK, strike.inward), (observed.position, OBSERVED, None)]
    return cropped([marked_picture(mesh, marks, up=up, view=view, skin=skin)])[0]
