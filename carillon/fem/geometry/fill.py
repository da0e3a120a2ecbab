"""Which voxels of a grid a surface fills.

Measured on the Stanford bunny (holes in its base) and the teapot (open, intersecting shells):
filling between the outermost surface voxels (``orthographic``) makes the solid half a voxel thicker
on every side, 23 % too much volume for the bunny at resolution 32, and so stiffens thin parts far
more than the voxel size suggests. Winding numbers at voxel centres get the volume within 1 %, but
break thin ears and handles off. ``winding``, the default, therefore keeps the voxels that are at
least half full and, of the others, those without which the solid would lose a piece or a handle.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from carillon.fem.geometry.topology import pieces, thin_to

if TYPE_CHECKING:  # Its import takes long, and many commands need no surface.
    import trimesh

#: Sample points per voxel edge for the filled fraction of a voxel. Odd, so that "half full" puts a
#: wall at the middle of a voxel; an even number would move every wall outwards.
SAMPLES = 3

#: Winding number from which a point is inside. Below the 1/2 of a point on the surface by more than
#: the error of fast winding numbers (0.02), so that a wall through sample points is not ragged.
INSIDE = 0.45

#: Factor between the volumes of the voxels and of the solid beyond which they are not alike.
TOO_THIN = 2.0

#: Points whose winding number is computed at once.
CHUNK = 2_000_000


@dataclass(frozen=True, eq=False)
class Grid:
    """Cubes of edge `edge` [m], `shape` of them along the axes, from the corner `origin` [m]."""

    origin: np.ndarray
    edge: float
    shape: tuple[int, int, int]


def bounding_grid(surface: trimesh.Trimesh, resolution: int) -> Grid:
    """Grid with `resolution` voxels along the longest side of the bounding box, centred on it."""
    low, high = np.asarray(surface.bounds)
    edge = float((high - low).max() / resolution)
    # The tolerance keeps a side of exactly n voxels from rounding up to n + 1.
    shape = np.maximum(np.ceil((high - low) / edge - 1e-6), 1).astype(int)
    return Grid(
        (low + high - edge * shape) / 2, edge, (int(shape[0]), int(shape[1]), int(shape[2]))
    )


def winding_fill(surface: trimesh.Trimesh, grid: Grid) -> tuple[np.ndarray, np.ndarray]:
    """Voxels at least half inside the surface, plus those that hold it together.

    Inside is where the generalised winding number exceeds `INSIDE` in magnitude (Jacobson et al.
    2013; Barill et al. 2018), which is defined for surfaces with holes and for overlapping shells.
    The filled fraction of a voxel comes from `SAMPLES`^3 points. Starting from every voxel that the
    surface touches or encloses, those less than half full go, the emptiest first, unless that
    would change the pieces, tunnels or cavities of the solid. Gaps narrower than a voxel close;
    pieces that hold less than half a voxel are left out.

    Returns
    -------
    filled : (nx, ny, nz) bool
        All False if its volume is not within a factor of `TOO_THIN` of the volume inside the
        surface, or its length of the surface's: only a skeleton would be left of walls that thin,
        and less of needles.
    origin : (3,)
        Corner of the grid [m].
    """
    surface = cut(surface, 2 * grid.edge)
    touched = touched_voxels(surface, grid)
    fraction = filled_fraction(surface, grid, touched)
    half_full = fraction >= 0.5
    labels, _ = pieces(touched | half_full)
    held = np.bincount(labels.ravel(), weights=fraction.ravel())
    # Loose triangles and other crumbs enclose next to nothing.
    cover = (labels > 0) & (held >= 0.5)[labels]
    filled = thin_to(cover, half_full, fraction)
    inside, count = fraction.sum(), np.count_nonzero(filled)
    alike = inside / TOO_THIN <= count <= inside * TOO_THIN
    if not alike or TOO_THIN * _length(filled) < _length(cover):
        filled = np.zeros_like(filled)
    return filled, grid.origin


def _length(voxels: np.ndarray) -> int:
    """Voxels along the longest side of the box around those that are set."""
    cells = np.argwhere(voxels)
    return int(np.ptp(cells, axis=0).max()) + 1 if len(cells) else 0


def centre_fill(surface: trimesh.Trimesh, grid: Grid) -> tuple[np.ndarray, np.ndarray]:
    """Voxels whose centre is inside the surface by its winding number; thin parts may break off."""
    index = np.indices(grid.shape).reshape(3, -1).T
    return _inside(surface, grid, index + 0.5).reshape(grid.shape), grid.origin


def orthographic_fill(surface: trimesh.Trimesh, grid: Grid) -> tuple[np.ndarray, np.ndarray]:
    """Voxels that the surface touches and all between them along every axis.

    Voxels are centred on multiples of the edge, so there is one more along the longest side, and
    the solid is about half a voxel thicker than the surface on every side.
    """
    voxels = surface.voxelized(grid.edge).fill(method="orthographic")
    origin = np.asarray(voxels.transform)[:3, 3] - grid.edge / 2
    return np.array(voxels.matrix, dtype=bool), origin


FILLS: dict[str, Callable[[trimesh.Trimesh, Grid], tuple[np.ndarray, np.ndarray]]] = {
    "winding": winding_fill,
    "centre": centre_fill,
    "orthographic": orthographic_fill,
}


def filled_fraction(surface: trimesh.Trimesh, grid: Grid, touched: np.ndarray) -> np.ndarray:
    """Fraction of each voxel that is inside the surface, (nx, ny, nz), in steps of 1/SAMPLES^3."""
    fraction = centre_fill(surface, grid)[0].astype(float)
    # A voxel that the surface does not touch is full or empty, and its centre says which.
    near = np.argwhere(touched)
    step = (np.arange(SAMPLES) + 0.5) / SAMPLES
    offsets = np.stack(np.meshgrid(step, step, step, indexing="ij"), axis=-1).reshape(-1, 3)
    points = (near[:, None, :] + offsets).reshape(-1, 3)
    inside = _inside(surface, grid, points).reshape(len(near), -1)
    fraction[tuple(near.T)] = inside.mean(axis=1)
    return fraction


def touched_voxels(surface: trimesh.Trimesh, grid: Grid) -> np.ndarray:
    """Voxels that hold a vertex of the surface after its edges are cut to half a voxel or less."""
    vertices = np.asarray(cut(surface, grid.edge / 2).vertices)
    index = np.floor((vertices - grid.origin) / grid.edge).astype(int)
    touched = np.zeros(grid.shape, dtype=bool)
    touched[tuple(np.clip(index, 0, np.array(grid.shape) - 1).T)] = True
    return touched


def cut_triangles(surface: trimesh.Trimesh, max_edge: float) -> float:
    """Number of triangles once every edge is cut to at most `max_edge` [m], see `cut`.

    Cutting halves all edges of a triangle until the longest one is short enough.
    """
    longest = np.asarray(surface.edges_unique_length)[surface.faces_unique_edges].max(axis=1)
    halvings = np.ceil(np.log2(np.maximum(longest / max_edge, 1.0)))
    return float((4.0**halvings).sum())


def cut(surface: trimesh.Trimesh, max_edge: float) -> trimesh.Trimesh:
    """The same surface in triangles with edges of at most `max_edge` [m]."""
    import trimesh

    vertices, faces = trimesh.remesh.subdivide_to_size(
        surface.vertices, surface.faces, max_edge=max_edge, max_iter=30
    )
    return trimesh.Trimesh(vertices, faces, process=False)


def _inside(surface: trimesh.Trimesh, grid: Grid, points: np.ndarray) -> np.ndarray:
    """Whether `points` (p, 3), in voxels from the grid's corner, are inside the surface."""
    return np.asarray(np.abs(winding_numbers(surface, grid, points)) > INSIDE)


def winding_numbers(surface: trimesh.Trimesh, grid: Grid, points: np.ndarray) -> np.ndarray:
    """Winding numbers (p,) of the surface about `points` (p, 3), in voxels from the grid's corner.

    The hierarchy behind them suffers from long triangles, see `cut`.
    """
    import igl

    # In voxel units, so that the result does not depend on the unit of length.
    vertices = np.ascontiguousarray((surface.vertices - grid.origin) / grid.edge)
    faces = np.ascontiguousarray(surface.faces, dtype=np.int64)
    numbers = np.empty(len(points))
    for start in range(0, len(points), CHUNK):
        part = slice(start, start + CHUNK)
        numbers[part] = igl.fast_winding_number(vertices, faces, np.ascontiguousarray(points[part]))
    return numbers
