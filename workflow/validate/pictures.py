"""Pictures of the solid: its surface, its voxels, its material, and where it is struck."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable
from typing import Any

import matplotlib.image
import matplotlib.pyplot as plt
import numpy as np
import trimesh
from numpy.typing import NDArray

from solver.contact import Contact
from solver.geometry import HexMesh
from solver.geometry.picture import draw, draw_surface, guess_up, mark, view_of
from workflow.report.mode_pictures import PICTURE_INCHES, cropped
from workflow.report.style import COLOURS, SETTINGS, pixels

Array = NDArray[np.float64]
Pixels = NDArray[np.uint8]

COLOUR_MAP = "viridis"
STRUCK, OBSERVED = COLOURS["random"], COLOURS["hcms_ec"]
"""Colours of the marks."""
ROOM_FOR_ARROW = 0.12
"""Share of the picture that its border takes where an arrow may reach beyond the solid."""


def solid_pictures(surface: trimesh.Trimesh, mesh: HexMesh, young: Array) -> list[Pixels]:
    """The surface, the voxels, and the voxels coloured by log10 of their moduli (m,) [Pa]."""
    up = guess_up(mesh)
    return cropped(
        [
            _picture(lambda axes: draw_surface(axes, surface.vertices, surface.faces, mesh, up)),
            _picture(lambda axes: draw(axes, mesh, up=up)),
            _picture(lambda axes: draw(axes, mesh, values=np.log10(young), up=up, cmap=COLOUR_MAP)),
        ]
    )


def struck_picture(mesh: HexMesh, strike: Contact, observed: Contact) -> Pixels:
    """The voxels with an arrow where they are struck and a ring where they are watched."""
    up = guess_up(mesh)
    view = view_of(mesh, -np.array([strike.inward, observed.inward]), up)

    def struck(axes: Any) -> None:
        axes.computed_zorder = False
        draw(axes, mesh, up=up, view=view)
        mark(axes, mesh, strike.position, STRUCK, strike.inward, up=up)
        mark(axes, mesh, observed.position, OBSERVED, up=up)

    return cropped([_picture(struck, ROOM_FOR_ARROW)])[0]


def png_uri(picture: Pixels) -> str:
    """RGBA values (h, w, 4) as a data URI."""
    file = io.BytesIO()
    matplotlib.image.imsave(file, np.ascontiguousarray(picture), format="png")
    return f"data:image/png;base64,{base64.b64encode(file.getvalue()).decode()}"


def _picture(draw_on: Callable[[Any], Any], border: float = 0.0) -> Pixels:
    with plt.rc_context(SETTINGS):
        figure = plt.figure(figsize=PICTURE_INCHES, layout="none")
        inside = 1.0 - 2.0 * border
        axes = figure.add_axes((border, border, inside, inside), projection="3d")
        draw_on(axes)
        axes.patch.set_alpha(0.0)
    return pixels(figure)
