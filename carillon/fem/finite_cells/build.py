"""Finite cells of a surface."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from carillon.errors import UserError
from carillon.fem.block import NODES
from carillon.fem.finite_cells.cells import FiniteCells, assemble_cells
from carillon.fem.finite_cells.inside import CUT, EMPTY, FULL, Inside, find_inside
from carillon.fem.finite_cells.parts import find_parts, meetings
from carillon.fem.finite_cells.shapes import octant_weights
from carillon.fem.finite_cells.weights import weights_of_parts
from carillon.fem.geometry.fill import Grid, bounding_grid
from carillon.fem.geometry.voxels import COMPONENTS, checked_resolution

if TYPE_CHECKING:  # Its import takes long, and many commands need no surface.
    import trimesh

SMALLEST_OCTANT = 1e-6
"""Share of a voxel below which it counts as empty."""
SMALLEST_PIECE = 0.5
"""Volume [voxels] below which a loose piece is a crumb, and left out."""
LOST = 1.1
"""Ratio of the volumes by two halves of the lines beyond which parts slip between the lines."""
TRIAL_FACTORS = (1.25, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0)
"""Factors by which a resolution is raised in search of one at which nothing is lost, or the solid
is in one piece."""
TRIAL_GRID = 4_000_000
PIECES_GRID = 200_000
"""Largest grids [voxels] of such trials."""


def finite_cells(
    surface: trimesh.Trimesh, resolution: int, components: str = "error", name: str = "mesh"
) -> FiniteCells:
    """Cover the inside of a surface with quadratic cells.

    Parameters
    ----------
    surface
        Triangles in metres; holes and overlapping shells are allowed.
    resolution
        Lattice spacings along the longest side of the bounding box, at least 2. Cells have twice
        that edge, and a node every spacing.
    components
        ``"error"`` rejects a solid in several pieces, ``"largest"`` keeps the largest.
    name
        Name of the solid, for messages.

    Raises
    ------
    UserError
        If the resolution is not an integer >= 2 or needs too large a lattice, if the surface
        encloses nothing, or walls too thin for the lattice, or the solid is in pieces.

    Examples
    --------
    >>> from carillon.fem.geometry.builtin import builtin_surface
    >>> cells = finite_cells(builtin_surface("bell"), 12)
    >>> bool(abs(cells.volume / 8.79e-4 - 1.0) < 0.01), len(cells) > 100
    (True, True)
    """
    resolution = checked_resolution(surface, resolution, name)
    if components not in COMPONENTS:
        raise UserError(
            f"components {components!r} is unknown, expected one of {', '.join(COMPONENTS)}"
        )
    grid = even_grid(surface, resolution)
    inside = find_inside(surface, grid)
    if not _holds(inside):
        raise UserError(_lost(surface, inside, resolution, grid, name))
    parts = _Parts.of_inside(inside)
    piece, volumes = parts.pieces()
    kept = np.flatnonzero(volumes >= SMALLEST_PIECE)
    if not len(kept):
        raise UserError(_lost(surface, inside, resolution, grid, name))
    if len(kept) > 1 and components == "error":
        raise UserError(_in_pieces(surface, volumes[kept], resolution, name))
    return parts.mesh(piece == volumes.argmax(), grid)


def even_grid(surface: trimesh.Trimesh, resolution: int) -> Grid:
    """The bounding grid, centred, with an even number of voxels along each axis."""
    grid = bounding_grid(surface, resolution)
    shape = np.array(grid.shape)
    more = shape % 2
    even = [int(size) for size in shape + more]
    return Grid(grid.origin - 0.5 * more * grid.edge, grid.edge, (even[0], even[1], even[2]))


def _holds(inside: Inside) -> bool:
    if inside.sheet:
        return False
    if not (inside.state == CUT).any():
        return bool((inside.state == FULL).any())
    volumes = inside.volumes()
    return 0.0 < min(volumes) and max(volumes) <= LOST * min(volumes)


def _lost(surface: trimesh.Trimesh, inside: Inside, resolution: int, grid: Grid, name: str) -> str:
    start = f"mesh {name!r} at resolution {resolution}"
    nothing = f"{start} encloses nothing; expected a surface around a solid, repair the mesh"
    if inside.sheet:
        return nothing
    better = _better_resolution(surface, resolution, _holds, TRIAL_GRID)
    if better:
        return (
            f"{start} has parts far thinner than the lattice spacing of {grid.edge:.3g} m, "
            f"which are lost between its lines; raise --resolution to {better}"
        )
    if any(len(each.low) for each in inside.pieces):
        return (
            f"{start} has parts far thinner than the lattice spacing of {grid.edge:.3g} m, which "
            "are lost between its lines; raise --resolution or make them thicker"
        )
    return nothing


def _in_pieces(surface: trimesh.Trimesh, volumes: np.ndarray, resolution: int, name: str) -> str:
    listed = ", ".join(f"{volume:,.0f}" for volume in sorted(volumes)[:-5:-1])
    # A piece for each closed shell: these are apart, and no lattice joins them.
    apart = 1 < surface.body_count <= len(volumes)
    better = None if apart else _better_resolution(surface, resolution, _is_one_piece, PIECES_GRID)
    remedy = f"raise --resolution to {better}, where it is one" if better else "join them"
    return (
        f"mesh {name!r} at resolution {resolution} is in {len(volumes):,} pieces ({listed} voxels "
        f"the largest); {remedy}, or pass --components largest to keep the largest"
    )


def _is_one_piece(inside: Inside) -> bool:
    volumes = _Parts.of_inside(inside).pieces()[1]
    return _holds(inside) and np.count_nonzero(volumes >= SMALLEST_PIECE) == 1


def _better_resolution(
    surface: trimesh.Trimesh, resolution: int, accepts: Callable[[Inside], bool], largest: int
) -> int | None:
    """A higher resolution that `accepts` what is inside, on a grid of at most `largest` voxels."""
    for factor in TRIAL_FACTORS:
        better = int(np.ceil(factor * resolution))
        trial = even_grid(surface, better)
        if np.prod([float(size) for size in trial.shape]) > largest:
            return None
        if accepts(find_inside(surface, trial)):
            return better
    return None


@dataclass(frozen=True)
class _Parts:
    """Parts of cells, and which of them meet.

    Attributes
    ----------
    grid : (p, 3)
        Lowest voxel of each part's cell.
    row, weights
        See `FiniteCells`.
    met : (m, 3)
        Parts that meet, the lower one first, and the axis across their face.
    """

    grid: np.ndarray
    row: np.ndarray
    weights: np.ndarray
    met: np.ndarray

    @classmethod
    def of_inside(cls, inside: Inside) -> _Parts:
        """Parts of all cells that hold anything."""
        state, facing = _by_cell(inside.state), _by_cell(inside.facing)
        number = np.full(state.shape[:3], -1, dtype=np.int64)
        there = (state != EMPTY).any(axis=3)
        number[there] = np.arange(np.count_nonzero(there))
        cells = 2 * np.argwhere(there)[:, ::-1]
        whole = (state[there] == FULL).all(axis=1)
        cut = np.flatnonzero(~whole)
        state, facing, corners = state[there][cut], facing[there][cut], cells[cut]
        labels, counts = find_parts(corners, state, inside.pieces)
        first = np.cumsum(counts) - counts
        weights = weights_of_parts(
            corners, state, facing, inside.pieces, labels, first, int(counts.sum())
        )
        weights[weights.sum(axis=2) < SMALLEST_OCTANT / 8.0] = 0.0
        parts = np.ones(len(cells), dtype=np.int64)
        parts[cut] = counts
        owner = np.repeat(np.arange(len(cells)), parts)
        row = np.zeros(len(owner), dtype=np.int64)
        # Faces in planes of the lattice touch cells that they do not cut.
        is_cut = np.abs(weights - octant_weights()).max(axis=(1, 2)) > SMALLEST_OCTANT
        row[~whole[owner]] = np.where(is_cut, 1 + np.arange(len(weights)), 0)
        table = np.concatenate([octant_weights()[None], weights])
        first_part = np.cumsum(parts) - parts
        among_cut = np.full(len(cells), -1)
        among_cut[cut] = np.arange(len(cut))
        met = []
        for axis in range(3):
            lower, upper = _neighbours(number, axis)
            pair, below, above = meetings(among_cut[lower], among_cut[upper], labels, axis).T
            below, above = first_part[lower[pair]] + below - 1, first_part[upper[pair]] + above - 1
            met.append(np.stack([below, above, np.full(len(pair), axis)], axis=1))
        return cls(cells[owner], row, table, np.concatenate(met))._without_empty()

    def _without_empty(self) -> _Parts:
        holds = self.weights.any(axis=(1, 2))[self.row]
        number = np.cumsum(holds) - 1
        met = self.met[holds[self.met[:, :2]].all(axis=1)]
        met = np.column_stack([number[met[:, :2]], met[:, 2]])
        return _Parts(self.grid[holds], self.row[holds], self.weights, met)

    def pieces(self) -> tuple[np.ndarray, np.ndarray]:
        """Number (p,) of the piece of the solid that each part is of, and volumes [voxels]."""
        shape = (len(self.row),) * 2
        graph = sp.coo_matrix((np.ones(len(self.met)), tuple(self.met[:, :2].T)), shape=shape)
        piece = connected_components(graph, directed=False)[1]
        return piece, np.bincount(piece, 8.0 * self.weights.sum(axis=(1, 2))[self.row])

    def mesh(self, kept: np.ndarray, grid: Grid) -> FiniteCells:
        """Mesh of the parts (p,) that are `kept`: neighbours share the nodes of the faces."""
        count = len(self.row)
        ends = len(NODES) * np.arange(count)[:, None] + np.arange(len(NODES))
        joined = []
        for axis in range(3):
            below, above, _ = self.met[self.met[:, 2] == axis].T
            low, high = (np.flatnonzero(NODES[:, axis] == side) for side in (0, 2))
            joined.append(np.stack([ends[below][:, high].ravel(), ends[above][:, low].ravel()]))
        left, right = np.concatenate(joined, axis=1)
        graph = sp.coo_matrix((np.ones(len(left)), (left, right)), shape=(ends.size,) * 2)
        label = connected_components(graph, directed=False)[1][ends[kept]]
        _, first, inverse = np.unique(label, return_index=True, return_inverse=True)
        places = (self.grid[kept][:, None] + NODES).reshape(-1, 3)[first]
        order = np.lexsort((first, *places.T))
        rank = np.empty(len(order), dtype=np.int64)
        rank[order] = np.arange(len(order))
        rows, row = np.unique(np.append(0, self.row[kept]), return_inverse=True)
        return assemble_cells(
            rank[inverse].reshape(-1, len(NODES)),
            places[order],
            row[1:],
            self.weights[rows],
            grid.origin,
            grid.edge,
        )


def _by_cell(values: np.ndarray) -> np.ndarray:
    """Values (nz / 2, ny / 2, nx / 2, 8) of the octants of each cell, in bit order."""
    nx, ny, nz = (size // 2 for size in values.shape)
    octants = values.reshape(nx, 2, ny, 2, nz, 2).transpose(4, 2, 0, 5, 3, 1)
    return np.ascontiguousarray(octants.reshape(nz, ny, nx, 8))


def _neighbours(number: np.ndarray, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of cells that follow each other along an axis, of an array in (z, y, x)."""
    turned = np.moveaxis(number, 2 - axis, 0)
    lower, upper = turned[:-1].ravel(), turned[1:].ravel()
    both = (lower >= 0) & (upper >= 0)
    return lower[both], upper[both]
