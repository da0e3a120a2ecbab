"""Pictures of a mode that the coarse model gets wrong: its strain energy, and what is to blame."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon.fem.geometry import HexMesh
from carillon.fem.geometry.picture import VIEW, draw, guess_up, view_of
from solver.studies.coarsening.pictures import ModePicture, read_pictures
from workflow.studies.base.cases import Case
from workflow.studies.base.media import COLOUR_MAP, cropped, embedded, solid_picture
from workflow.studies.coarsening.results import CoarseningStudy

Array = NDArray[np.float64]

DECADES = 3.0
"""Powers of ten that colours stand for, below the largest share."""
BLAME_COLOURS = "plasma"
BORDER = 0.08
"""Share of the picture that its border takes, since solids near the eye reach beyond the frame."""


def mode_pictures(study: CoarseningStudy, case: Case, mode: int) -> list[dict[str, Any]]:
    """The deformed solid, coloured by shares of strain energy and of blame, for a page."""
    mesh, pictures = read_pictures(study.pictures_of(case))
    picture = next(each for each in pictures if each.mode == mode)
    look: dict[str, Any] = {
        "up": guess_up(mesh),
        "limits": (-DECADES, 0.0),
        "view": _view(mesh, picture.energy),
    }
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


def _view(mesh: HexMesh, energy: Array) -> tuple[float, float]:
    """From the side on which the energy is."""
    middles = mesh.grid + 0.5
    outward = (energy[:, None] * middles).sum(axis=0) / energy.sum() - middles.mean(axis=0)
    length = float(np.linalg.norm(outward))
    if length < 1.0:
        return VIEW
    return view_of(mesh, outward[None] / length)
