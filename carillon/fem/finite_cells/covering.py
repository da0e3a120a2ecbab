"""The cells of a lattice that cover a solid, of which some may be divided."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from carillon.arrays import Array, Flags, Index, Surface
from carillon.errors import UserError
from carillon.fem.element import CORNERS
from carillon.fem.finite_cells.absorbing import hosts, taken_in
from carillon.fem.finite_cells.cells import FiniteCells, assemble_cells
from carillon.fem.finite_cells.cover import LatticeCover, divided_cover, faces_of_halves
from carillon.fem.finite_cells.joining import Faces, joined_nodes
from carillon.fem.geometry.grid import Grid

SMALLEST_PIECE = 0.5
"""Volume [voxels] below which a loose piece is a crumb, and left out."""


@dataclass(frozen=True)
class Division:
    """Finite cells some of which are divided into eight."""

    cells: FiniteCells
    """The mesh."""
    parent: Index
    """(c,) undivided cell that each is, or is part of."""
    voxel: Index
    """(m,) voxel of the undivided mesh whose material each voxel has."""


@dataclass(frozen=True)
class Covering:
    """A surface, and the cells of a lattice that cover its inside."""

    surface: Surface
    name: str
    """See `finite_cells`."""
    grid: Grid
    """Lattice of the voxels."""
    cover: LatticeCover
    """The cells and their parts."""
    kept: Flags
    """(p,) which parts are of the solid."""

    @cached_property
    def cells(self) -> FiniteCells:
        """All cells, undivided."""
        return CellParts.of_cover(self.cover).chosen(self.kept).cells(self.grid, self.grid.edge)

    def divided(self, places: Index) -> Division:
        """The same, but with cells at `places` (d, 3), their lowest voxels, divided into eight.

        Raises UserError if the finer lattice shows that the solid is in pieces.
        """
        places = self._with_guests(places)
        whole, half = self.cover, divided_cover(self.surface, self.grid, places)
        undivided = np.ones(len(whole.places), dtype=bool)
        undivided[whole.cells_at(places)] = False
        parts = CellParts.of_two(whole, half, undivided)
        leaves = np.append(self.kept & undivided[whole.owner], np.ones(len(half), dtype=bool))
        chosen = self._one_piece(parts, leaves)
        cells = parts.chosen(chosen).cells(self.grid, self.grid.edge / 2.0)
        among = self.kept & ~whole.slight
        parent = np.append(np.arange(len(whole)), parents(whole, half, among))
        parent = (np.cumsum(among) - 1)[parent[chosen & ~parts.slight]]
        return Division(cells, parent, voxels_of_parents(cells, self.cells, parent))

    def _with_guests(self, places: Index) -> Index:
        """The places and those of parts that cells there have taken in."""
        parts = CellParts.of_cover(self.cover).chosen(self.kept)
        host = hosts(parts.faces, parts.slight, parts.volumes)
        there = np.zeros(len(self.cover.places), dtype=bool)
        there[self.cover.cells_at(places)] = True
        guests = parts.slight & (host >= 0) & there[self.cover.owner[self.kept]][host]
        return np.unique(np.concatenate([places, parts.corner[guests]]), axis=0)

    def _one_piece(self, parts: CellParts, leaves: Flags) -> Flags:
        """Those of the `leaves` (p,) that are of the largest piece; the others must be crumbs."""
        own = np.flatnonzero(leaves)
        piece = parts.faces.chosen(leaves).pieces(len(own))
        sizes = np.bincount(piece, parts.volumes[own])
        if np.count_nonzero(sizes >= SMALLEST_PIECE) > 1:
            raise UserError(
                f"mesh {self.name!r} falls apart where cells are divided; raise the resolution, or "
                "join its parts"
            )
        chosen = np.zeros(len(leaves), dtype=bool)
        chosen[own[piece == sizes.argmax()]] = True
        return chosen


@dataclass(frozen=True)
class CellParts:
    """Parts of the cells of one lattice or two, all of whose arrays have a row for each."""

    corner: Index
    span: Index
    """(p, 3), (p,): lowest corners and edges of their cells, in steps: voxels, or halves of
    them."""
    row: Index
    volumes: Array
    slight: Flags
    """(p,) see `LatticeCover`; volumes are in voxels."""
    weights: Array
    """That the rows are of."""
    faces: Faces
    """Where they meet."""

    @classmethod
    def of_cover(cls, cover: LatticeCover) -> CellParts:
        """Those of one lattice."""
        span = np.full(len(cover), 2)
        faces = Faces(cover.met, np.empty((0, 4), dtype=np.int64))
        return cls(cover.grid, span, cover.row, cover.volumes, cover.slight, cover.weights, faces)

    @classmethod
    def of_two(cls, whole: LatticeCover, half: LatticeCover, undivided: Flags) -> CellParts:
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

    def chosen(self, kept: Flags) -> CellParts:
        """Those that are kept (p,)."""
        names = ("corner", "span", "row", "volumes", "slight")
        arrays = {name: getattr(self, name)[kept] for name in names}
        return replace(self, **arrays, faces=self.faces.chosen(kept))

    def cells(self, grid: Grid, step: float) -> FiniteCells:
        """The mesh of those that are not slight, by steps [m] from the corner of a lattice."""
        nodes, places = joined_nodes(self.corner, self.span, self.faces, self.slight)
        host = hosts(self.faces, self.slight, self.volumes)
        row, weights = taken_in(self.corner, self.span, host, self.row, self.weights)
        rows, row = np.unique(np.append(0, row[~self.slight]), return_inverse=True)
        is_mixed = bool((self.span > 2).any())
        return assemble_cells(nodes, places, row[1:], weights[rows], grid.origin, step, is_mixed)


def pieces(cover: LatticeCover) -> tuple[Index, Array]:
    """Number (p,) of the piece of the solid that each part is of, and volumes [voxels]."""
    piece = CellParts.of_cover(cover).faces.pieces(len(cover))
    volumes = np.where(cover.slight, 0.0, cover.volumes)
    return piece, np.bincount(piece, volumes).astype(np.float64)


def parents(whole: LatticeCover, half: LatticeCover, kept: Flags) -> Index:
    """Part (p,) of `whole` that each part of `half` lies in: of those kept, that with most in it.

    Where none has anything there it is the first that is kept in the place, or the first of all.
    """
    cells = whole.cells_at(half.grid // 4 * 2)
    last = np.append(whole.first[1:], len(whole.number))
    first_kept = int(np.flatnonzero(kept)[0])
    found = np.empty(len(half), dtype=np.int64)
    label = _labels(half)
    for part, cell in enumerate(cells):
        numbers = whole.number[whole.first[cell] : last[cell]]
        there = np.flatnonzero((numbers >= 0) & kept[numbers])
        if len(there) <= 1:
            found[part] = numbers[there[0]] if len(there) else first_kept
            continue
        shares = _shared_boxes(whole, half, part, int(cell), int(label[part]))
        found[part] = numbers[there[shares[there + 1].argmax()]]
    return found


def _labels(cover: LatticeCover) -> Index:
    number = np.flatnonzero(cover.number >= 0)
    return number - cover.first[cover.owner] + 1


def _shared_boxes(
    whole: LatticeCover, half: LatticeCover, part: int, cell: int, label: int
) -> Index:
    """Boxes that a part of a small cell shares with those of a whole one, by their labels."""
    size = whole.labels.shape[1]
    low = size // 2 * (half.grid[part] // 2 % 2)
    x, y, z = (slice(start, start + size // 2) for start in low)
    coarse = whole.labels[whole.cut[cell], x, y, z]
    fine = coarse.repeat(2, axis=0).repeat(2, axis=1).repeat(2, axis=2)
    row = half.cut[half.owner[part]]
    there = np.ones(fine.shape, dtype=bool) if row < 0 else half.labels[row] == label
    return np.bincount(fine[there], minlength=int(whole.labels.max(initial=0)) + 1)


def voxels_of_parents(cells: FiniteCells, undivided: FiniteCells, parent: Index) -> Index:
    """Voxel (m,) of the undivided mesh that each voxel of cells with a `parent` (c,) lies in.

    Where that is empty it is the nearest one of the parent.
    """
    cell, own = np.nonzero(cells.voxels >= 0)
    is_half = (cells.span == 2) & (cells.mesh.edge < undivided.mesh.edge)
    place = (cells.grid // 2 % 2) @ np.array([1, 2, 4])
    octant = np.where(is_half[cell], place[cell], own)
    far = np.abs(CORNERS[:, None] - CORNERS).sum(axis=2)[octant]
    candidates = undivided.voxels[parent[cell]]
    nearest = np.where(candidates >= 0, far, far.max() + 1).argmin(axis=1)
    found = np.empty(cells.mesh.n_cells, dtype=np.int64)
    found[cells.voxels[cell, own]] = candidates[np.arange(len(cell)), nearest]
    return found
