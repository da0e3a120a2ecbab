"""Random solids with material: thin and thick, straight and oblique, alone and joined."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial.transform import Rotation

from carillon.fem.geometry import HexMesh
from carillon.fem.geometry.hexmesh import hexmesh_from_grid
from carillon.fem.materials import young_modulus

Array = NDArray[np.float64]
Filled = NDArray[np.bool_]

MATERIALS = ("uniform", "uniform", "uniform", "smooth", "noise", "random", "two-region")
"""Materials of consecutive solids; one is the case that most people meet, so it comes often."""

RESOLUTIONS = (14, 25)
"""Least and past-the-largest size of the lattice that a solid is made in."""

CELLS = (150, 6500)
"""Least and past-the-largest number of voxels."""

HALF_THICKNESS = (0.6, 3.0)
"""Of plates, rods and shells, in voxels."""

BOX_FRACTION = 0.15
"""Share of solids that are boxes of whole blocks, where nothing is void."""


def ellipsoid(x: Array, n: int, rng: Generator) -> Filled:
    """Solid ellipsoid; `x` are positions (..., 3) in voxels about its centre, turned."""
    radii = rng.uniform(0.15, 0.45, 3) * n
    return np.asarray(((x / radii) ** 2).sum(axis=-1) < 1.0)


def brick(x: Array, n: int, rng: Generator) -> Filled:
    """Solid cuboid."""
    return np.asarray((np.abs(x) < rng.uniform(0.15, 0.45, 3) * n).all(axis=-1))


def plate(x: Array, n: int, rng: Generator) -> Filled:
    """Thin rectangular plate."""
    half = np.append(rng.uniform(0.25, 0.5, 2) * n, rng.uniform(*HALF_THICKNESS))
    return np.asarray((np.abs(x) < half).all(axis=-1))


def rod(x: Array, n: int, rng: Generator) -> Filled:
    """Round rod."""
    radius = rng.uniform(*HALF_THICKNESS) + 0.5
    near = (x[..., 1:] ** 2).sum(axis=-1) < radius**2
    return np.asarray((np.abs(x[..., 0]) < rng.uniform(0.3, 0.5) * n) & near)


def shell(x: Array, n: int, rng: Generator) -> Filled:
    """Ellipsoidal shell, often open at one end."""
    radii = rng.uniform(0.25, 0.45, 3) * n
    distance = np.abs(np.sqrt(((x / radii) ** 2).sum(axis=-1)) - 1.0) * radii.min()
    kept = distance < rng.uniform(*HALF_THICKNESS)
    if rng.random() < 0.6:
        kept &= x[..., 2] > -rng.uniform(0.0, 0.5) * radii[2]
    return np.asarray(kept)


def ring(x: Array, n: int, rng: Generator) -> Filled:
    """Torus."""
    tube = np.hypot(np.hypot(x[..., 0], x[..., 1]) - rng.uniform(0.2, 0.35) * n, x[..., 2])
    return np.asarray(tube < rng.uniform(*HALF_THICKNESS) + 0.7)


def blob(x: Array, n: int, rng: Generator) -> Filled:
    """Level set of smooth noise, denser towards the centre."""
    noise = ndimage.gaussian_filter(rng.standard_normal(x.shape[:3]), rng.uniform(1.5, 3.5))
    radius = np.sqrt((x**2).sum(axis=-1)) / (0.5 * n)
    return np.asarray(noise / noise.std() > 2.5 * radius - 1.2)


PRIMITIVES: tuple[Callable[[Array, int, Generator], Filled], ...] = (
    ellipsoid,
    brick,
    plate,
    rod,
    shell,
    ring,
    blob,
)


def _lattice(n: int) -> Array:
    axis = np.arange(n) + 0.5
    return np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1)


def _joined(rng: Generator) -> Filled:
    """One to three primitives, the largest piece of what they fill."""
    n = int(rng.integers(*RESOLUTIONS))
    lattice = _lattice(n)
    filled = np.zeros((n, n, n), dtype=bool)
    for _ in range(int(rng.choice([1, 2, 3], p=[0.4, 0.35, 0.25]))):
        turn = Rotation.random(random_state=rng).as_matrix() if rng.random() < 0.75 else np.eye(3)
        local = (lattice - rng.uniform(0.3, 0.7, 3) * n) @ turn
        filled |= PRIMITIVES[int(rng.integers(len(PRIMITIVES)))](local, n, rng)
    labels, count = ndimage.label(filled)
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    return np.asarray(labels == 1 + sizes[1:].argmax()) if count else filled


def _box(rng: Generator) -> Filled:
    """Box of whole blocks."""
    return np.ones(2 * rng.integers(4, 13, 3), dtype=bool)


def random_solid(seed: int, number: int) -> tuple[HexMesh, Array, str]:
    """Solid `number` of a seed: mesh, moduli (m,) [Pa] and the material's name.

    Shapes that came out too small or too large are drawn again. A solid's first cell is even or odd
    along each axis by chance, so walls lie across blocks in all ways; a box starts with a block.
    """
    rng = np.random.default_rng([seed, number])
    boxed = rng.random() < BOX_FRACTION
    while True:
        filled = _box(rng) if boxed else _joined(rng)
        if CELLS[0] <= filled.sum() < CELLS[1]:
            break
    grid = np.argwhere(filled)
    grid -= grid.min(axis=0)
    if not boxed:
        grid += rng.integers(0, 2, 3)
    mesh = hexmesh_from_grid(grid.astype(np.int32), np.zeros(3), 1.0 / (1 + int(grid.max())))
    name = MATERIALS[number % len(MATERIALS)]
    return mesh, young_modulus(name, mesh, int(rng.integers(2**31))), name
