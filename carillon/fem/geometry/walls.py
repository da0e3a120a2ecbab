"""Solids of one thickness about a surface, as sheet metal and shells are: a wall."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from carillon.arrays import Array, Index, Surface
from carillon.command_line.logs import warn_once
from carillon.errors import UserError
from carillon.fem.geometry.convex import ConvexBodies
from carillon.fem.geometry.grid import Grid
from carillon.fem.geometry.offset_bodies import offset_bodies
from carillon.fem.geometry.sheets import Sheets
from carillon.fem.geometry.size import length_in_words
from carillon.fem.geometry.surface import load_surface, surface_name
from carillon.fem.geometry.wall_skin import wall_skin

ABOUT, INSIDE, OUTSIDE = "about", "inside", "outside"
SIDES = (ABOUT, INSIDE, OUTSIDE)
"""Where a wall lies: half on each side of the surface, or all on one."""
MOST_TRIANGLES = 2_000_000
"""Triangles of a surface that a wall may have; each takes about a kilobyte."""


@dataclass(frozen=True)
class WallSize:
    """How thick a wall is, and on which side of its surface it lies."""

    thickness: float
    """[m]"""
    side: str = ABOUT
    """One of `SIDES`."""

    def of(self, surface: Surface, name: str = "mesh") -> Wall:
        """The wall of a surface, see `Wall.of_surface`."""
        return Wall.of_surface(surface, self.thickness, self.side, name)

    def read(self, mesh: str, unit: float = 1.0, up: str | None = None) -> Wall:
        """The wall of the surface in a file, or `builtin:NAME`, see `load_surface`."""
        return self.of(load_surface(mesh, unit, is_sheet=True, up=up), surface_name(mesh))


@dataclass(frozen=True, eq=False)
class Wall:
    """A solid wall that follows a surface.

    Its points are as near to the surface as the thickness says: half of it on both sides, or all of
    it on one. So outer edges are round, inner ones sharp, and walls that meet are one. Where the
    surface ends the wall is cut across it, so that it does not reach beyond.

    Examples
    --------
    >>> from carillon.fem.geometry.builtin import builtin_surface
    >>> wall = Wall.of_surface(builtin_surface("box"), 0.004, "outside")
    >>> bool(np.allclose(wall.extents, [0.208, 0.158, 0.108]))
    True
    """

    surface: Surface
    """The triangles that it follows [m]."""
    thickness: float
    """[m]"""
    side: str
    """One of `SIDES`."""
    sheets: Sheets
    """The same triangles, none twice, over the longest side of the surface."""

    @classmethod
    def of_surface(
        cls, surface: Surface, thickness: float, side: str = ABOUT, name: str = "mesh"
    ) -> Wall:
        """The wall of a surface.

        Raises UserError if the thickness is not positive or larger than the surface, if this has no
        area or too many triangles, or if the wall lies on one side, and triangles are turned both
        ways so that they do not tell which.
        """
        what = f"mesh {name!r}"
        if side not in SIDES:
            raise UserError(f"side {side!r} of a wall is unknown, expected one of {_listed()}")
        if not thickness > 0.0:
            raise UserError(
                f"{what}: found a wall of {thickness:g} m, expected a thickness above 0, such as "
                "0.001 or '1 mm'"
            )
        vertices, faces = np.asarray(surface.vertices), np.asarray(surface.faces)
        if len(faces) > MOST_TRIANGLES:
            raise UserError(
                f"{what}: has {len(faces):,} triangles, expected at most {MOST_TRIANGLES:,} for a "
                "wall; simplify the mesh"
            )
        longest = float(np.ptp(np.asarray(surface.bounds), axis=0).max())
        if not thickness <= longest:
            raise UserError(
                f"{what}: found a wall of {length_in_words(thickness)} about a surface whose "
                f"longest side is {length_in_words(longest)}, expected less; see whether both "
                "are in the right unit"
            )
        sheets = Sheets.of_surface(vertices, faces)
        if sheets.is_closed and sheets.volume < 0.0:
            sheets = Sheets.of_surface(vertices, faces[:, ::-1])
        if not len(sheets):
            raise UserError(
                f"{what}: has no triangle with an area, expected a surface that a wall can follow"
            )
        if side != ABOUT and not sheets.is_closed and not sheets.is_turned_alike:
            raise UserError(
                f"{what}: triangles are turned both ways, so that its {side} is not told apart; "
                f"turn their normals alike, or put the wall about it ({ABOUT})"
            )
        return cls(surface, thickness, side, sheets)

    @property
    def size(self) -> WallSize:
        """Thickness and side."""
        return WallSize(self.thickness, self.side)

    @cached_property
    def heights(self) -> tuple[float, float]:
        """Where it begins and ends along the normals [m]."""
        half = 0.5 * self.thickness
        ends = {
            ABOUT: (-half, half),
            INSIDE: (-self.thickness, 0.0),
            OUTSIDE: (0.0, self.thickness),
        }
        return ends[self.side]

    @property
    def is_of_inside(self) -> bool:
        """Whether a closed surface tells which of two sides is which."""
        return self.sheets.is_closed and self.side != ABOUT

    @cached_property
    def bounds(self) -> Array:
        """Lowest and highest corner (2, 3) of the box about it [m]."""
        if self.is_of_inside and self.side == INSIDE:
            return np.asarray(self.surface.bounds)
        return self.lowest + self.scale * self._bodies[1]

    @property
    def extents(self) -> Array:
        """Sides (3,) of that box [m]."""
        return np.ptp(self.bounds, axis=0)

    @cached_property
    def skin(self) -> Surface:
        """Triangles around it [m]: the surface moved to both sides, joined at its rims.

        Edges are sharp, where those of the wall itself may be round. The first vertices are those
        of the surface, by number, on the side that the normals point to.
        """
        from trimesh import Trimesh  # Its import takes long.

        given = np.asarray(self.surface.vertices, dtype=float)
        low, high = (each / self.scale for each in self.heights)
        points, faces = wall_skin(self.sheets, low, high, len(given))
        points = self.lowest + self.scale * points
        unused = np.isnan(points).any(axis=1)
        points[unused] = given[np.flatnonzero(unused)]
        return Trimesh(points, faces, process=False)

    def say_filled(self, name: str) -> None:
        """Warn that the wall leaves no hollow in the closed surface that it follows."""
        warn_once(
            f"mesh {name!r}: a wall of {length_in_words(self.thickness)} leaves no hollow, the "
            "solid is full; see whether its unit is right, or leave out the wall"
        )

    @property
    def scale(self) -> float:
        """Longest side of the surface [m]."""
        return float(np.ptp(self._corners, axis=0).max())

    @property
    def lowest(self) -> Array:
        """Lowest corner (3,) of the surface [m]."""
        return np.asarray(self._corners.min(axis=0))

    @cached_property
    def _corners(self) -> Array:
        used = np.asarray(self.surface.vertices)[np.unique(np.asarray(self.surface.faces))]
        return np.stack([used.min(axis=0), used.max(axis=0)])

    @cached_property
    def _bodies(self) -> tuple[ConvexBodies, Array]:
        """Bodies whose union it is, but for what a closed surface cuts off, and the box about."""
        low, high = (each / self.scale for each in self.heights)
        return offset_bodies(self.sheets, low, high, not self.is_of_inside)

    def bodies_on(self, grid: Grid) -> ConvexBodies:
        """Convex bodies in units of a lattice, whose union the wall is.

        If it `is_of_inside`, they may reach through the surface.
        """
        return self._bodies[0].moved(
            (grid.origin - self.lowest) / self.scale, grid.edge / self.scale
        )

    def surface_on(self, grid: Grid) -> tuple[Array, Index]:
        """Vertices (v, 3) and triangles (t, 3) of the surface, in units of a lattice."""
        return self._placed(self.sheets.vertices, grid), self.sheets.triangles

    def faces_on(self, grid: Grid) -> tuple[Array, Index]:
        """Faces of the wall over its triangles, and across its rims, in units of a lattice."""
        low, high = (each / self.scale for each in self.heights)
        normals = self.sheets.normals[:, None]
        sides = [self.sheets.corners + z * normals for z in (low, high)]
        gaps = self.sheets.gaps
        rims = gaps.is_rim & ~self.sheets.joined_rims
        normal = self.sheets.normals[gaps.halves[rims, 0] // 3]
        ends = self.sheets.vertices[gaps.ends[rims]]
        quad = [ends[:, end] + z * normal for end, z in ((0, low), (1, low), (1, high), (0, high))]
        sides += [np.stack([quad[i] for i in three], axis=1) for three in ((0, 1, 2), (0, 2, 3))]
        corners = np.concatenate(sides).reshape(-1, 3)
        return self._placed(corners, grid), np.arange(len(corners)).reshape(-1, 3)

    def _placed(self, points: Array, grid: Grid) -> Array:
        return (self.lowest - grid.origin + self.scale * points) / grid.edge


def _listed() -> str:
    return ", ".join(SIDES)
