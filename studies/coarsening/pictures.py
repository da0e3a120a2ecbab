"""Pictures of a mode that the coarse model gets wrong: its strain energy, and what is to blame."""

from functools import partial
from typing import Any

import numpy as np

from carillon.arrays import Array, Index
from carillon.drawing.solid import VIEW, draw, guess_up, looks_at
from carillon.fem.geometry import HexMesh
from studies.base.cases import Case
from studies.base.media import COLOUR_MAP, cropped, embedded, solid_picture
from studies.coarsening.picture_file import ModePicture, read_pictures
from studies.coarsening.results import CoarseningStudy

DECADES = 3.0
"""Powers of ten that colours stand for, below the largest share."""
BLAME_COLOURS = "plasma"
BORDER = 0.08
"""Share of the picture that its border takes, since solids near the eye reach beyond the frame."""


def mode_pictures(study: CoarseningStudy, case: Case, mode: int) -> list[dict[str, Any]]:
    """The deformed solid, coloured by shares of strain energy and of blame, for a page."""
    mesh, pictures = read_pictures(study.pictures_of(case))
    picture = next(each for each in pictures if each.mode == mode)
    up = guess_up(mesh)
    view = best_view(mesh, picture.energy, up)
    look: dict[str, Any] = {"up": up, "view": view, "limits": (-DECADES, 0.0)}
    drawn = [
        solid_picture(
            partial(_draw, mesh=mesh, picture=picture, values=values, cmap=cmap, **look), BORDER
        )
        for values, cmap in ((picture.energy, COLOUR_MAP), (picture.blame, BLAME_COLOURS))
    ]
    shown = ("strain energy", "blame")
    return [embedded(each, shows=name) for each, name in zip(cropped(drawn), shown, strict=True)]


def _draw(axes: Any, mesh: HexMesh, picture: ModePicture, values: Array, **look: Any) -> None:
    floor = 10.0**-DECADES
    scaled = np.log10(np.maximum(values / values.max(), floor))
    draw(axes, mesh, displacement=picture.displacement, values=scaled, **look)


def best_view(mesh: HexMesh, energy: Array, up: str) -> tuple[float, float]:
    """Elevation and azimuth [degrees] from where most of the energy (m,) of the cells is seen."""
    views = [
        (elevation, VIEW[1] + turn)
        for elevation in (VIEW[0], -VIEW[0])
        for turn in np.arange(0.0, 360.0, 15.0)
    ]
    return max(views, key=lambda view: energy[_seen(mesh, view, up)].sum())


def _seen(mesh: HexMesh, view: tuple[float, float], up: str) -> Index:
    eye = looks_at(mesh, np.eye(3), view, up)
    across = np.linalg.svd(eye[None])[2][1:]
    nearest_first = np.argsort(-(mesh.grid @ eye), kind="stable")
    places = np.round(mesh.grid[nearest_first] @ across.T)
    return nearest_first[np.unique(places, axis=0, return_index=True)[1]]
