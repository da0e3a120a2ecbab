"""The cells of a lattice that cover a solid, of which some may be divided."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from carillon.arrays import Array, Flags, Index, Surface
from carillon.errors import UserError
from carillon.fem.finite_cells.absorbing import Held, hosts, taken_in
from carillon.fem.finite_cells.basis import Basis, basis, voxel_places
from carillon.fem.finite_cells.cells import FiniteCells, merged, places_along
from carillon.fem.finite_cells.cover import LatticeCover, divided_cover, faces_of_halves
from carillon.fem.finite_cells.joining import Faces, joined_nodes, joined_voxels
from carillon.fem.geometry.grid import Grid
from carillon.fem.geometry.hexmesh import HexMesh
from carillon.fem.geometry.walls import Wall

SMALLEST_PIECE = 0.5
"""Volume [voxels] below which a loose piece is a crumb, and left out."""
MOST_LEVELS = 4
"""Largest number of times that a cell is divided."""

Divisions = Sequence[Index]
"""Cells (d, 3) of every level that are divided, in edges of these from the lattice's corner."""


@dataclass(frozen=True)
class Covering:
    """A surface or a wall, and the cells of a lattice that cover its inside."""

    surface: Surface | Wall
    name: str
    degree: int
    """See `finite_cells`."""
    grid: Grid
    """Lattice of the voxels."""
    cover: LatticeCover
    """The undivided cells and their parts."""
    kept: Flags
    """(p,) which parts are of the solid."""

    @cached_property
    def cells(self) -> FiniteCells:
        """All cells, undivided."""
        every = np.ones(len(self.cover.places), dtype=bool)
        parts = CellParts.of_levels(self._basis, [self.cover], [every], [self._voxels[1]])
        return parts.chosen(self.kept).cells(self._basis, self._voxels[0])

    def divided(self, divisions: Divisions) -> FiniteCells:
        """The same, but with some cells of each level divided into eight.

        More are divided so that of two that share a face or an edge neither has more than twice
        the other's edge. Raises UserError if a finer lattice shows that the solid is in pieces.

        Examples
        --------
        >>> from carillon.fem.finite_cells.build import covering
        >>> from carillon.fem.geometry.builtin import builtin_surface
        >>> cover = covering(builtin_surface("bell"), 12)
        >>> cells = cover.divided([cover.cells.corner[:3] // cover.cells.span[0]])
        >>> len(cells) > len(cover.cells), cells.mesh is cover.cells.mesh
        (True, True)
        """
        covers, undivided = [self.cover], []
        for level, requested in enumerate(balanced(divisions, self.shape)):
            cover = covers[-1]
            places = requested[cover.cells_at(cover.count * requested) >= 0]
            if not len(places):
                break
            places = _with_guests(cover, places)
            whole = np.ones(len(cover.places), dtype=bool)
            whole[cover.cells_at(cover.count * places)] = False
            undivided.append(whole)
            surface, grid = self.surface, self.grid
            covers.append(divided_cover(surface, grid, places, level + 1, self._basis))
        undivided.append(np.ones(len(covers[-1].places), dtype=bool))
        voxels = [self._voxels[1]]
        root = np.arange(len(self.cover))
        is_cell = self.kept & ~self.cover.slight
        for whole_cover, half in zip(covers, covers[1:]):
            root = root[parents(whole_cover, half, is_cell[root])]
            voxels.append(self._voxels_in(half, root))
        parts = CellParts.of_levels(self._basis, covers, undivided, voxels)
        leaves = [flags[cover.owner] for cover, flags in zip(covers, undivided, strict=True)]
        leaves[0] &= self.kept
        chosen = self._one_piece(parts, np.concatenate(leaves))
        return parts.chosen(chosen).cells(self._basis, self._voxels[0])

    @property
    def shape(self) -> Index:
        """(3,) undivided cells of the lattice along its axes."""
        return np.array(self.grid.shape) // self.degree

    @property
    def _basis(self) -> Basis:
        return basis(self.degree)

    @cached_property
    def _voxels(self) -> tuple[HexMesh, Index]:
        """The voxels, and numbers (p, count^3) of those of each undivided part, -1 if none."""
        cover = self.cover
        is_cell = self.kept & ~cover.slight
        own = np.flatnonzero(is_cell[cover.part])
        part, voxel = cover.part[own], cover.voxel[own]
        grid = cover.corner[part] + voxel_places(cover.count)[voxel]
        order = np.lexsort((part, *grid.T))
        part, voxel, grid = part[order], voxel[order], grid[order].astype(np.int32)
        met = cover.met[is_cell[cover.met[:, :2]].all(axis=1)]
        corners, node_grid = joined_voxels(cover.corner, cover.count, part, voxel, met)
        numbers = np.full((len(cover), cover.count**3), -1)
        numbers[part, voxel] = np.arange(len(order))
        return HexMesh(corners, grid, node_grid, self.grid.origin, self.grid.edge), numbers

    def _voxels_in(self, cover: LatticeCover, root: Index) -> Index:
        """Voxels (p, v) that voxels of small cells lie in, or the cells if these are no larger.

        `root` (p,) are the undivided parts that they lie in. Where one has nothing there, it is the
        nearest voxel in which it has something.
        """
        table, every = self._voxels[1], voxel_places(self.cover.count)
        places = voxel_places(places_along(self.degree, cover.level))
        # Voxels of lines may be halves, or quarters, of the voxels.
        halvings = (cover.count * 2**cover.level // self.degree).bit_length() - 1
        own = (cover.corner[:, None] + places >> halvings) - self.cover.corner[root][:, None]
        found = np.empty(own.shape[:2], dtype=np.int64)
        for column in range(own.shape[1]):
            far = ((own[:, column, None] - every) ** 2).sum(axis=2)
            nearest = np.where(table[root] >= 0, far, far.max() + 1).argmin(axis=1)
            found[:, column] = table[root, nearest]
        return found

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


def balanced(divisions: Divisions, shape: Index) -> list[Index]:
    """Cells (d, 3) of each level that are divided if those of `divisions` are.

    `shape` (3,) are the undivided cells of the lattice along its axes. Raises UserError if cells
    would be divided more than `MOST_LEVELS` times.

    Examples
    --------
    >>> one = np.array([[0, 0, 0]])
    >>> [len(places) for places in balanced([one[:0], one + 1], np.array([2, 2, 2]))]
    [7, 1]
    """
    if len(divisions) > MOST_LEVELS:
        raise UserError(f"cells are divided {len(divisions)} times, at most {MOST_LEVELS} are")
    result = [np.asarray(places, dtype=np.int64).reshape(-1, 3) for places in divisions]
    steps = np.array([[x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)])
    steps = steps[np.abs(steps).sum(axis=1) < 3]  # those at corners alone may differ more
    for level in range(len(result) - 1, 0, -1):
        beside = (result[level][:, None] + steps).reshape(-1, 3)
        inside = ((beside >= 0) & (beside < shape * 2**level)).all(axis=1)
        both = np.concatenate([result[level - 1], beside[inside] // 2])
        result[level - 1] = np.unique(both, axis=0)
    return result


def _with_guests(cover: LatticeCover, places: Index) -> Index:
    """The places (d, 3) of cells, and those of parts that cells there have taken in."""
    faces = Faces(cover.met, np.empty((0, 4), dtype=np.int64))
    host = hosts(faces, cover.slight, cover.volumes)
    there = np.zeros(len(cover.places), dtype=bool)
    there[cover.cells_at(cover.count * places)] = True
    guests = cover.slight & (host >= 0) & there[cover.owner][host]
    return np.unique(np.concatenate([places, cover.corner[guests] // cover.count]), axis=0)


@dataclass(frozen=True)
class CellParts:
    """Parts of the cells of several lattices, all of whose arrays have a row for each."""

    corner: Index
    span: Index
    """(p, 3), (p,): lowest corners and edges of their cells, in steps of the finest nodes."""
    volumes: Array
    """(p,) [voxels]."""
    slight: Flags
    """(p,) see `LatticeCover`."""
    held: Held
    place: Index
    voxel: Index
    """(e,) what they have of voxels: where in the cell, x fastest, and of which."""
    weights: Array
    faces: Faces
    """Where they meet."""
    step: float
    """Distance between neighbouring nodes of the finest lattice [voxel edges]."""

    @classmethod
    def of_levels(
        cls,
        basis: Basis,
        covers: Sequence[LatticeCover],
        undivided: Sequence[Flags],
        voxels: Sequence[Index],
    ) -> CellParts:
        """Join the parts of several lattices, whose cells have half the edge of the one before.

        `undivided` (c,) cells of each are not replaced by those of the next. See
        `Covering._voxels_in` for the `voxels` of each.
        """
        finest = len(covers) - 1
        first = np.append(0, np.cumsum([len(cover) for cover in covers]))
        tables = [_merged_voxels(basis, cover) for cover in covers]
        rows = np.append(0, np.cumsum([len(table[3]) for table in tables]))
        alike = [cover.met + np.array([at, at, 0]) for cover, at in zip(covers, first)]
        unlike = [np.empty((0, 4), dtype=np.int64)]
        for level in range(finest):
            met = faces_of_halves(covers[level], covers[level + 1], undivided[level])
            unlike.append(met + np.array([first[level], first[level + 1], 0, 0]))
        counts = [places_along(basis.degree, level) for level in range(finest + 1)]
        middles = [
            (voxel_places(count)[table[1]] + 0.5) / count for count, table in zip(counts, tables)
        ]
        part = np.concatenate([table[0] + at for table, at in zip(tables, first)])
        row = np.concatenate([table[2] + at for table, at in zip(tables, rows)])
        return cls(
            np.concatenate(
                [
                    cover.corner * (basis.degree * 2 ** (finest - k) // cover.count)
                    for k, cover in enumerate(covers)
                ]
            ),
            np.repeat(
                [basis.degree * 2 ** (finest - k) for k in range(finest + 1)],
                [len(cover) for cover in covers],
            ),
            np.concatenate(
                [cover.volumes * basis.degree**3 / 8.0**k for k, cover in enumerate(covers)]
            ),
            np.concatenate([cover.slight for cover in covers]),
            Held(part, np.concatenate(middles), row),
            np.concatenate([table[1] for table in tables]),
            np.concatenate([ids[table[0], table[1]] for ids, table in zip(voxels, tables)]),
            np.concatenate([table[3] for table in tables]),
            Faces(np.concatenate(alike), np.concatenate(unlike)),
            1.0 / 2**finest,
        )

    def chosen(self, kept: Flags) -> CellParts:
        """Those that are kept (p,)."""
        number = np.cumsum(kept) - 1
        own = kept[self.held.cell]
        held = Held(number[self.held.cell[own]], self.held.middle[own], self.held.row[own])
        names = ("corner", "span", "volumes", "slight")
        arrays = {name: getattr(self, name)[kept] for name in names}
        arrays |= {"place": self.place[own], "voxel": self.voxel[own]}
        return replace(self, **arrays, held=held, faces=self.faces.chosen(kept))

    def cells(self, basis: Basis, mesh: HexMesh) -> FiniteCells:
        """The mesh of those that are not slight, of which `mesh` has the voxels."""
        joined = joined_nodes(basis, self.corner, self.span, self.faces, self.slight)
        host = hosts(self.faces, self.slight, self.volumes)
        row, weights = taken_in(basis, self.corner, self.span, host, self.held, self.weights)
        own = ~self.slight[self.held.cell]
        used, row = np.unique(row[own], return_inverse=True)
        number = np.cumsum(~self.slight) - 1
        cells = FiniteCells(
            basis.degree,
            joined.nodes.astype(np.int32),
            self.corner[~self.slight].astype(np.int32),
            self.span[~self.slight].astype(np.int32),
            joined.kinds,
            joined.places.astype(np.int32),
            self.step * mesh.edge,
            mesh,
            number[self.held.cell[own]].astype(np.int32),
            self.place[own].astype(np.int32),
            self.voxel[own].astype(np.int32),
            row.ravel().astype(np.int32),
            weights[used] @ basis.from_lines,
            weights[used],
        )
        return merged(cells)


def _merged_voxels(basis: Basis, cover: LatticeCover) -> tuple[Index, Index, Index, Array]:
    """`part`, `voxel`, `row` and `weights` of a cover; of cells no larger than a voxel together."""
    if places_along(basis.degree, cover.level) > 1:
        return cover.part, cover.voxel, cover.row, cover.weights
    parts = np.arange(len(cover))
    start = np.searchsorted(cover.part, np.arange(len(cover) + 1))
    shape = (len(cover), len(cover.weights))
    matrix = sp.csr_matrix((np.ones(len(cover.row)), cover.row, start), shape)
    is_whole = (cover.row < cover.count**3)[start[:-1]] & (np.diff(start) == cover.count**3)
    is_whole &= np.bincount(cover.part, cover.row >= cover.count**3, minlength=len(cover)) == 0
    row = np.where(is_whole, 0, np.cumsum(~is_whole))
    whole = basis.line_voxels(1)
    weights = np.concatenate([whole, matrix[~is_whole] @ cover.weights])
    return parts, np.zeros(len(cover), dtype=np.int64), row, weights


def pieces(cover: LatticeCover) -> tuple[Index, Array]:
    """Number (p,) of the piece of the solid that each part is of, and volumes [voxels]."""
    piece = Faces(cover.met, np.empty((0, 4), dtype=np.int64)).pieces(len(cover))
    volumes = np.where(cover.slight, 0.0, cover.volumes * cover.count**3)
    return piece, np.bincount(piece, volumes).astype(np.float64)


def parents(whole: LatticeCover, half: LatticeCover, kept: Flags) -> Index:
    """Part (p,) of `whole` that each part of `half` lies in: of those kept, that with most in it.

    Where none has anything there it is the first that is kept in the place, or the first of all.
    """
    cells = whole.cells_at(half.corner // half.count // 2 * whole.count)
    last = np.append(whole.first[1:], len(whole.number))
    first_kept = int(np.flatnonzero(kept)[0])
    found = np.empty(len(half), dtype=np.int64)
    label = half.label
    for part, cell in enumerate(cells):
        numbers = whole.number[whole.first[cell] : last[cell]]
        there = np.flatnonzero((numbers >= 0) & kept[numbers])
        if len(there) <= 1:
            found[part] = numbers[there[0]] if len(there) else first_kept
            continue
        shares = _shared_boxes(whole, half, part, int(cell), int(label[part]))
        found[part] = numbers[there[shares[there + 1].argmax()]]
    return found


def _shared_boxes(
    whole: LatticeCover, half: LatticeCover, part: int, cell: int, label: int
) -> Index:
    """Boxes that a part of a small cell shares with those of a whole one, by their labels."""
    size, boxes = whole.labels.shape[1], half.labels.shape[1]
    low = half.corner[part] // half.count % 2
    at = [(start * boxes + np.arange(boxes)) * size // (2 * boxes) for start in low]
    coarse = whole.labels[whole.cut[cell]][np.ix_(*at)]
    row = half.cut[half.owner[part]]
    there = np.ones(coarse.shape, dtype=bool) if row < 0 else half.labels[row] == label
    return np.bincount(coarse[there], minlength=int(whole.labels.max(initial=0)) + 1)
