"""Young's modulus fields: one value [Pa] per fine cell."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np

from carillon.arrays import Array
from carillon.errors import UserError
from carillon.fem.moduli import read_moduli, require_moduli
from carillon.files.paths import require_file

if TYPE_CHECKING:  # Geometry needs trimesh, whose import takes long; names of materials do without.
    from carillon.fem.geometry import HexMesh


UNIFORM_YOUNG = 1.0e9
"""Modulus [Pa] of the uniform material and the geometric mean of the smooth one."""
TWO_REGION_YOUNG = (1.0e10, 1.0e8)
"""Moduli [Pa] on the two sides of the median plane across the longest extent."""
SMOOTH_MODES = 10
"""Laplacian eigenvectors that the smooth field combines, the constant left out."""
SMOOTH_DECADES = 1.0
"""Half the range of the smooth field: log10 of its moduli spans twice this."""
RANDOM_DECADES = (-2.0, 1.0)
"""Decades [GPa] that the random material draws from, log-uniformly per cell."""
NOISE_YOUNG = (1.0e7, 1.0e10)
"""Moduli [Pa] between which the noise material draws, uniformly per cell."""
NAMES = ("uniform", "smooth", "two-region", "random", "noise")


def smooth_field(mesh: HexMesh, seed: int = 0) -> Array:
    """Values (m,) within -1 and 1: a random sum of the lowest Laplacian eigenvectors."""
    from carillon.fem.laplacian import laplacian_modes  # Its import takes long.

    _, modes = laplacian_modes(mesh, SMOOTH_MODES + 1)
    modes = modes[:, 1:]
    weights = np.random.default_rng(seed).standard_normal(modes.shape[1])
    weights /= np.arange(1, modes.shape[1] + 1)
    field = modes @ weights
    peak = np.abs(field).max()
    return np.asarray(field / peak if peak > 0.0 else field)


def young_modulus(
    name: str,
    mesh: HexMesh,
    seed: int = 0,
    label: str = "mesh",
    unit: float = 1.0,
    up: str | None = None,
) -> Array:
    """Moduli (m,) [Pa] of a material: one of `NAMES`, or a file.

    A file holds one value per cell, or is a mesh of volume elements or an image (.vti) with Young's
    moduli: then each cell has that of the element in which its middle lies, or which is nearest.
    Raises UserError if there is no such file, for what `carillon.fem.moduli` refuses, or if a mesh
    or an image is elsewhere than the cells. `unit`: metres per unit of its coordinates, whose axis
    `up` is turned to z.

    Examples
    --------
    >>> from carillon.fem.geometry import hexmesh_from_grid
    >>> mesh = hexmesh_from_grid(np.array([[0, 0, 0], [1, 0, 0]]), np.zeros(3), 0.5)
    >>> young_modulus("two-region", mesh).tolist()
    [10000000000.0, 100000000.0]
    """
    count, draw = mesh.n_cells, np.random.default_rng(seed).uniform
    match name:
        case "uniform":
            return np.full(count, UNIFORM_YOUNG)
        case "smooth":
            return UNIFORM_YOUNG * 10.0 ** (SMOOTH_DECADES * smooth_field(mesh, seed))
        case "two-region":
            position = mesh.grid[:, np.argmax(np.ptp(mesh.grid, axis=0))]
            return np.where(position < np.median(position), *TWO_REGION_YOUNG)
        case "random":
            return 1e9 * 10.0 ** draw(*RANDOM_DECADES, count)
        case "noise":
            return draw(*NOISE_YOUNG, count)
    if not os.path.exists(name):
        raise UserError(
            f"material {name!r} is neither a file nor one of the names {', '.join(NAMES)}; "
            "steel, glass, oak and the like are materials of regions (--regions)"
        )
    path = require_file(name, "a material, a file of moduli")
    if not _is_cell_file(name):
        return read_moduli(path, count, label)
    return _of_cells(name, mesh, unit, up)


def _is_cell_file(name: str) -> bool:
    from carillon.fem.geometry.labels import is_cell_file  # Its import takes long.

    return is_cell_file(name)


def _of_cells(name: str, mesh: HexMesh, unit: float, up: str | None) -> Array:
    from carillon.fem.geometry.labels import read_cell_moduli

    moduli = read_cell_moduli(name, unit, up=up)
    size = mesh.edge if mesh.span is None else mesh.edge * mesh.span[:, None]
    middles = mesh.origin + mesh.edge * mesh.grid + 0.5 * size
    return require_moduli(moduli.at(middles), mesh.n_cells, name, points=False)
