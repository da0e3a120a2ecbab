"""Pictures of solids as parts of a page."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable
from typing import Any

import matplotlib.image
import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

from workflow.report.mode_pictures import PICTURE_INCHES
from workflow.report.style import SETTINGS, pixels

Pixels = NDArray[np.uint8]

COLOUR_MAP = "viridis"
"""Of materials."""
ROOM_FOR_ARROW = 0.12
"""Share of the picture that its border takes where an arrow may reach beyond the solid."""


def solid_picture(draw_on: Callable[[Any], Any], border: float = 0.0) -> Pixels:
    """What `draw_on` draws on 3-D axes, with an empty border of that share of the picture."""
    with plt.rc_context(SETTINGS):
        figure = plt.figure(figsize=PICTURE_INCHES, layout="none")
        inside = 1.0 - 2.0 * border
        axes = figure.add_axes((border, border, inside, inside), projection="3d")
        draw_on(axes)
        axes.patch.set_alpha(0.0)
    return pixels(figure)


def png_uri(picture: Pixels) -> str:
    """RGBA values (h, w, 4) as a data URI."""
    file = io.BytesIO()
    matplotlib.image.imsave(file, np.ascontiguousarray(picture), format="png")
    return f"data:image/png;base64,{base64.b64encode(file.getvalue()).decode()}"
