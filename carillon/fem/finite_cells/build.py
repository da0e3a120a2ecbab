"""Finite cells of a surface."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from carillon.errors import UserError
from carillon.fem.finite_cells.absorbing import hosts, taken_in
from carillon.fem.finite_cells.cells import FiniteCells, assemble_cells
from carillon.fem.finite_cells.cover import LatticeCover, cover_of, divided_cover, faces_of_halves
from carillon.fem.finite_cells.descent import parents, voxels_of_parents
from carillon.fem.finite_cells.inside import CUT, FULL, Inside, find_inside
from carillon.fem.finite_cells.joining import Faces, joined_nodes
from carillon.fem.geometry.fill import Grid, bounding_grid
from carillon.fem.geometry.voxels import COMPONENTS, checked_resolution

if TYPE_CHECKING:  # Its import takes long, and many commands need no surface.
    import trimesh

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SMALLEST_PIECE = 0.5
"""Volume [voxels] below which a loose piece is a crumb, and left out."""
LOST = 1.1
"""Ratio of the volumes by two halves of the lines beyond which parts slip between the lines."""
TRIAL_FACTORS = (1.25, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0)
"""Factors by which a resolution is raised in search of one at which nothing is lost."""
TRIAL_GRID = 4_000_000
"""Largest grid [voxels] of such a trial."""


@dataclass(frozen=True)
class Division:
    """Finite cells some of which are divided into eight.

    Attributes
    ----------
    cells
        The mesh.
    parent : (c,)
        Undivided cell that each is, or is part of.
    voxel : (m,)
        Voxel of the undivided mesh whose material each voxel has.
    """

    cells: FiniteCells
    parent: Index
    voxel: Index


@dataclass(frozen=True)
class Covering:
    """A surface, and the cells of a lattice that cover its inside.

    Attributes
    ----------
    surface, name
        See `finite_cells`.
    grid
        Lattice of the voxels.
    cover
        The cells and their parts.
    kept : (p,)
        Which parts are of the solid.
    """

    surface: trimesh.Trimesh
    name: str
    grid: Grid
    cover: LatticeCover
    kept: NDArray[np.bool_]

    @cached_property
    def cells(self) -> FiniteCells:
        """All cells, undivided."""
        return _Parts.of_cover(self.cover).chosen(self.kept).cells(self.grid)

    def divided(self, places: Index) -> Division:
        """The same, but with cells at `places` (d, 3), their lowest voxels, divided into eight.

        Raises
        ------
        UserError
            If the finer lattice shows that the solid is in pieces.
        """
        whole, half = self.cover, divided_cover(self.surface, self.grid, places)
        undivided = np.ones(len(whole.places), dtype=bool)
        undivided[whole.cells_at(places)] = False
        parts = _Parts.of_two(whole, half, undivided)
        leaves = np.append(self.kept & undivided[whole.owner], np.ones(len(half), dtype=bool))
        chosen = self._one_piece(parts, leaves)
        cells = parts.chosen(chosen).cells(self.grid)
        among = self.kept & ~whole.slight
        parent = np.append(np.arange(len(whole)), parents(whole, half, among))
        parent = (np.cumsum(among) - 1)[parent[chosen & ~parts.slight]]
        return Division(cells, parent, voxels_of_parents(cells, self.cells, parent))

    def _one_piece(self, parts: _Parts, leaves: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Those of the `leaves` (p,) that are of the largest piece; the others must be crumbs."""
        own = np.flatnonzero(leaves)
        piece = parts.faces.chosen(leaves).pieces(len(own))
        sizes = np.bincount(piece, parts.volumes[own])
        if np.count_nonzero(sizes >= SMALLEST_PIECE) > 1:
            raise UserError(
                f"mesh {self.name!r} falls apart where cells are divided; raise --resolution, or "
                "join its parts"
            )
        chosen = np.zeros(len(leaves), dtype=bool)
        chosen[own[piece == sizes.argmax()]] = True
        return chosen


@dataclass(frozen=True)
class _Parts:
    """Parts of the cells of one lattice or two, all of whose arrays have a row for each.

    Attributes
    ----------
    corner, span : (p, 3), (p,)
        Lowest corners and edges of their cells, in steps: voxels, or halves of them.
    row, volumes, slight : (p,)
        See `LatticeCover`; volumes are in voxels.
    weights
        That the rows are of.
    faces
        Where they meet.
    """

    corner: Index
    span: Index
    row: Index
    volumes: Array
    slight: NDArray[np.bool_]
    weights: Array
    faces: Faces

    @classmethod
    def of_cover(cls, cover: LatticeCover) -> _Parts:
        """Those of one lattice."""
        span = np.full(len(cover), 2)
        faces = Faces(cover.met, np.empty((0, 4), dtype=np.int64))
        return cls(cover.grid, span, cover.row, cover.volumes, cover.slight, cover.weights, faces)

    @classmethod
    def of_two(
        cls, whole: LatticeCover, half: LatticeCover, undivided: NDArray[np.bool_]
    ) -> _Parts:
        """Those of a lattice and of one of half the edge, in place of its cells not `undivided`."""
        count, rows = len(whole), len(whole.weights)
        return cls(
            np.concatenate([2 * whole.grid, half.grid]),
            np.repeat([4, 2], [count, len(half)]),
            np.append(whole.row, np.where(half.row > 0, half.row + rows - 1, 0)),
            np.append(whole.volumes, half.volumes / 8.0),
            np.append(whole.slight, half.slight),
            np.concatenate([whole.weights, half.weights[1:]]),
            Faces(
                np.concatenate([whole.met, half.met + np.array([count, count, 0])]),
                faces_of_halves(whole, half, undivided) + np.array([0, count, 0, 0]),
            ),
        )

    def chosen(self, kept: NDArray[np.bool_]) -> _Parts:
        """Those that are kept (p,)."""
        return replace(
            self,
            corner=self.corner[kept],
            span=self.span[kept],
            row=self.row[kept],
            volumes=self.volumes[kept],
            slight=self.slight[kept],
            faces=self.faces.chosen(kept),
        )

    def cells(self, grid: Grid) -> FiniteCells:
        """The mesh of those that are not slight, on a lattice of these voxels."""
        nodes, places = joined_nodes(self.corner, self.span, self.faces, self.slight)
        host = hosts(self.faces, self.slight, self.volumes)
        row, weights = taken_in(self.corner, self.span, host, self.row, self.weights)
        rows, row = np.unique(np.append(0, row[~self.slight]), return_inverse=True)
        is_mixed = bool((self.span > 2).any())
        edge = grid.edge / 2.0 if is_mixed else grid.edge
        return assemble_cells(nodes, places, row[1:], weights[rows], grid.origin, edge, is_mixed)


def covering(
    surface: trimesh.Trimesh,
    resolution: int,
    components: str = "error",
    name: str = "mesh",
    grid: Grid | None = None,
) -> Covering:
    """The cells of a lattice that cover the inside of a surface; see `finite_cells`."""
    resolution = checked_resolution(surface, resolution, name)
    if components not in COMPONENTS:
        raise UserError(
            f"components {components!r} is unknown, expected one of {', '.join(COMPONENTS)}"
        )
    grid = grid or even_grid(surface, resolution)
    inside = find_inside(surface, grid)
    if not _holds(inside):
        raise UserError(_lost(surface, inside, resolution, grid, name))
    cover = cover_of(inside)
    piece = _Parts.of_cover(cover).faces.pieces(len(cover))
    volumes = np.bincount(piece, np.where(cover.slight, 0.0, cover.volumes))
    kept = np.flatnonzero(volumes >= SMALLEST_PIECE)
    if not len(kept):
        raise UserError(_lost(surface, inside, resolution, grid, name))
    if len(kept) > 1 and components == "error":
        listed = ", ".join(f"{volume:,.0f}" for volume in sorted(volumes[kept])[:-5:-1])
        raise UserError(
            f"mesh {name!r} at resolution {resolution} is in {len(kept):,} pieces ({listed} voxels "
            f"the largest); join them or pass --components largest to keep the largest"
        )
    return Covering(surface, name, grid, cover, piece == volumes.argmax())


def finite_cells(
    surface: trimesh.Trimesh,
    resolution: int,
    components: str = "error",
    name: str = "mesh",
    grid: Grid | None = None,
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
    grid
        Lattice of about this resolution around the solid, with an even number of voxels along each
        axis; `even_grid` if None.

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
    return covering(surface, resolution, components, name, grid).cells


def even_grid(surface: trimesh.Trimesh, resolution: int) -> Grid:
    """The bounding grid, centred, with an even number of voxels along each axis."""
    grid = bounding_grid(surface, resolution)
    shape = np.array(grid.shape)
    more = shape % 2
    even = [int(size) for size in shape + more]
    return Grid(grid.origin - 0.5 * more * grid.edge, grid.edge, (even[0], even[1], even[2]))


def _holds(inside: Inside) -> bool:
    if not (inside.state == CUT).any():
        return bool((inside.state == FULL).any())
    volumes = inside.volumes()
    return 0.0 < min(volumes) and max(volumes) <= LOST * min(volumes)


def _lost(surface: trimesh.Trimesh, inside: Inside, resolution: int, grid: Grid, name: str) -> str:
    start = f"mesh {name!r} at resolution {resolution}"
    for factor in TRIAL_FACTORS:
        better = int(np.ceil(factor * resolution))
        trial = even_grid(surface, better)
        if np.prod([float(size) for size in trial.shape]) > TRIAL_GRID:
            break
        if _holds(find_inside(surface, trial)):
            return (
                f"{start} has parts far thinner than the lattice spacing of {grid.edge:.3g} m, "
                f"which are lost between its lines; raise --resolution to {better}"
            )
    if any(len(each.low) for each in inside.pieces):
        return (
            f"{start} has parts far thinner than the lattice spacing of {grid.edge:.3g} m, which "
            "are lost between its lines; raise --resolution or make them thicker"
        )
    return f"{start} encloses nothing; expected a surface around a solid, repair the mesh"
