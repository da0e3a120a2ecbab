"""Young's modulus fields: one value [Pa] per fine cell."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from carillon.errors import UserError
from solver.laplacian import laplacian_modes

if TYPE_CHECKING:  # Geometry needs trimesh, whose import takes long; names of materials do without.
    from solver.geometry import HexMesh

Array = NDArray[np.float64]

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


def uniform(mesh: HexMesh) -> Array:
    """1 GPa everywhere."""
    return np.full(mesh.n_cells, UNIFORM_YOUNG)


def two_region(mesh: HexMesh) -> Array:
    """A half of 10 GPa and one of 0.1 GPa, cut at the median across the longest extent."""
    axis = int(np.argmax(np.ptp(mesh.grid, axis=0)))
    position = mesh.grid[:, axis]
    return np.where(position < np.median(position), *TWO_REGION_YOUNG)


def smooth(mesh: HexMesh, seed: int = 0) -> Array:
    """0.1 to 10 GPa: a smooth random field as log10 of the modulus."""
    return UNIFORM_YOUNG * 10.0 ** (SMOOTH_DECADES * smooth_field(mesh, seed))


def smooth_field(mesh: HexMesh, seed: int = 0) -> Array:
    """Values (m,) within -1 and 1: a random sum of the lowest Laplacian eigenvectors."""
    _, modes = laplacian_modes(mesh, SMOOTH_MODES + 1)
    modes = modes[:, 1:]
    weights = np.random.default_rng(seed).standard_normal(modes.shape[1])
    weights /= np.arange(1, modes.shape[1] + 1)
    field = modes @ weights
    peak = np.abs(field).max()
    return np.asarray(field / peak if peak > 0.0 else field)


def random(mesh: HexMesh, seed: int = 0) -> Array:
    """Independent in every cell, log-uniform over 0.01 to 10 GPa."""
    low, high = RANDOM_DECADES
    return 1e9 * 10.0 ** np.random.default_rng(seed).uniform(low, high, mesh.n_cells)


def noise(mesh: HexMesh, seed: int = 0) -> Array:
    """Independent in every cell, uniform over 0.01 to 10 GPa: seldom soft."""
    return np.random.default_rng(seed).uniform(*NOISE_YOUNG, mesh.n_cells)


def from_file(path: str | Path, mesh: HexMesh, label: str) -> Array:
    """Moduli [Pa] from a numpy `.npy` or text file, one per filled voxel in cell order.

    Raises
    ------
    UserError
        If the file is missing or unreadable, its length is wrong, or it holds values that are
        negative, not finite, or all zero.
    """
    path = Path(path)
    if not path.is_file():
        raise UserError(
            f"material '{path}' is neither a file nor one of the names {', '.join(NAMES)}"
        )
    try:
        values = np.load(path, allow_pickle=False) if path.suffix == ".npy" else np.loadtxt(path)
        values = np.asarray(values, dtype=float)
    except (OSError, ValueError, TypeError, EOFError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise UserError(
            f"{path}: is not readable as an array of numbers ({reason}); expected a .npy or text "
            "file with one Young's modulus [Pa] per voxel"
        ) from None
    return check(values.ravel(), mesh, str(path), label)


def check(values: Array, mesh: HexMesh, source: str, label: str) -> Array:
    """Return `values` if they are moduli [Pa] for the cells of `mesh`, else raise UserError."""
    if len(values) != mesh.n_cells:
        raise UserError(f"{source}: {len(values):,} values for {mesh.n_cells:,} voxels ({label})")
    bad = np.flatnonzero(~np.isfinite(values))
    if len(bad):
        raise UserError(
            f"{source}: {len(bad):,} values are not finite (the first at index {bad[0]}); "
            "expected Young's moduli [Pa]"
        )
    bad = np.flatnonzero(values < 0.0)
    if len(bad):
        raise UserError(
            f"{source}: {len(bad):,} values are negative (the first at index {bad[0]}: "
            f"{values[bad[0]]:g}); expected Young's moduli [Pa]"
        )
    if not values.any():
        raise UserError(f"{source}: all {len(values):,} values are zero; expected moduli [Pa]")
    bad = np.flatnonzero(values == 0.0)
    if len(bad):
        raise UserError(
            f"{source}: {len(bad):,} voxels have modulus zero (the first at index {bad[0]}); give "
            "them a small positive modulus or take them out of the mesh, since mass without "
            "stiffness has no place in a spectrum"
        )
    return values


def young_modulus(name: str, mesh: HexMesh, seed: int = 0, label: str = "mesh") -> Array:
    """Moduli (m,) [Pa] of a material: one of `NAMES`, or a file with one value per cell."""
    match name:
        case "uniform":
            return uniform(mesh)
        case "smooth":
            return smooth(mesh, seed)
        case "two-region":
            return two_region(mesh)
        case "random":
            return random(mesh, seed)
        case "noise":
            return noise(mesh, seed)
        case _:
            return from_file(name, mesh, label)
