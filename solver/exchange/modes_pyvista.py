"""Modes as a grid of PyVista, and pictures of them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from carillon.drawing.solid import DRAWN_AMPLITUDE
from carillon.drawing.with_pyvista import load_pyvista, plotter_of
from solver.exchange.displayed import displayed
from solver.exchange.modes_vtu import FREQUENCIES
from solver.files.modes_file import ModesFile

if TYPE_CHECKING:
    import pyvista

LENGTH = "displacement [kg^-1/2]"
"""Array with the length of the displacement in the mode that is drawn."""


def vector_name(number: int) -> str:
    """Name of the array with the displacements in a mode, counted from 1."""
    return f"mode {number}"


def modes_grid(file: ModesFile, numbers: range | None = None) -> pyvista.UnstructuredGrid:
    """The cubes that show a solid, with moduli and densities, and its modes at their points.

    `numbers` of modes are counted from 1; all unless given. Raises UserError if PyVista is missing.
    """
    pyvista = load_pyvista()
    assert file.modes is not None
    shown = displayed(file.model)
    grid = pyvista.UnstructuredGrid({shown.kind: shown.cells}, shown.points)
    for name, values in shown.data.items():
        grid.cell_data[name] = values
    for number in numbers or range(1, len(file.frequencies) + 1):
        shape = file.modes[:, number - 1].reshape(-1, 3)
        grid.point_data[vector_name(number)] = shown.vectors(shape)
    grid.field_data[FREQUENCIES] = file.frequencies
    return grid


def plot_mode(file: ModesFile, number: int, path: str | Path | None = None) -> pyvista.Plotter:
    """A plotter of the solid in a mode, counted from 1, see `plotter_of`.

    The largest displacement is drawn as `DRAWN_AMPLITUDE` of the solid's diagonal. Raises UserError
    if PyVista is missing, or the file cannot be written.
    """
    grid = modes_grid(file, range(number, number + 1))
    name = vector_name(number)
    lengths = np.linalg.norm(grid.point_data[name], axis=1)
    grid.point_data[LENGTH] = lengths
    largest = float(lengths.max()) or 1.0
    moved = grid.warp_by_vector(name, factor=DRAWN_AMPLITUDE * grid.length / largest)
    title = f"{name}, {file.frequencies[number - 1]:.4g} Hz"
    return plotter_of(moved, title, path, LENGTH)
