"""PyVista, where it is installed: pictures of grids, in a window, a notebook, or a file."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from carillon.drawing.solid import VIEW
from carillon.errors import UserError, one_line
from carillon.files.atomic import atomic_path

if TYPE_CHECKING:
    import pyvista

REQUIREMENTS = "workflow/envs/requirements-vtk.txt"
ENDINGS = (".png", ".jpg", ".tif", ".bmp")
"""Endings of the names of pictures."""
WINDOW = (1000, 750)
"""Size of a picture [px]."""


def load_pyvista() -> Any:
    """The package, imported when it is needed, as that takes long.

    Raises UserError if it cannot be imported.
    """
    try:
        return import_module("pyvista")
    except (ImportError, OSError) as error:  # OSError: a library that it needs.
        raise UserError(
            f"pyvista cannot be loaded ({one_line(str(error))}); "
            f"install it by pip install -r {REQUIREMENTS}"
        ) from None


def plotter_of(
    shape: pyvista.DataSet, title: str, path: str | Path | None = None, scalars: str | None = None
) -> pyvista.Plotter:
    """A plotter of a shape, in colours of its array `scalars`; its `show` opens it.

    With a path it draws off the screen, and has written the picture. Raises UserError if PyVista is
    missing, or the file cannot be written.
    """
    pyvista = load_pyvista()
    if path is not None and Path(path).suffix.lower() not in ENDINGS:
        raise UserError(f"{path}: expected a name that ends in one of {', '.join(ENDINGS)}")
    plotter = pyvista.Plotter(off_screen=path is not None or None, window_size=list(WINDOW))
    colour = {"color": "#e6cca3"} if scalars is None else {"scalars": scalars, "cmap": "viridis"}
    bar = {"title": scalars or "", "n_labels": 2, "position_x": 0.3, "position_y": 0.02}
    plotter.add_mesh(shape, scalar_bar_args=bar, **colour)
    plotter.add_text(title, font_size=11)
    elevation, azimuth = np.radians(VIEW)
    flat = np.cos(elevation)
    direction = (flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation))
    plotter.view_vector(direction, viewup=(0.0, 0.0, 1.0))
    if path is not None:
        with atomic_path(path) as temporary:
            plotter.screenshot(str(temporary))
    return plotter
