"""Cells that points lie in: those of meshes and of grids, whatever is known of them."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

from carillon.arrays import Array, Index
from carillon.fem.geometry.turning import turned_back


class LocatedCells(ABC):
    """Numbered cells with places."""

    @property
    @abstractmethod
    def n_cells(self) -> int:
        """Number of cells."""

    @property
    @abstractmethod
    def longest_side(self) -> float:
        """Longest side of the box around all cells [m], along their own axes."""

    @abstractmethod
    def cells_at(self, points: Array, nearest: bool = False) -> Index:
        """Cell (p,) that each of `points` (p, 3) [m] lies in, -1 outside all.

        With `nearest` points outside are in the cell nearest to them. On a face that cells have in
        common the point is in the first of these.
        """


@dataclass(frozen=True, eq=False)
class TurnedCells(LocatedCells):
    """Cells of a file that are turned so that one of its axes points up."""

    cells: LocatedCells
    """As they are in the file."""
    up: str
    """One of `carillon.parameters.quantities.UP_AXES`."""

    @property
    def n_cells(self) -> int:
        """Number of cells."""
        return self.cells.n_cells

    @property
    def longest_side(self) -> float:
        """Longest side of the box around all cells [m], along their own axes."""
        return self.cells.longest_side

    def cells_at(self, points: Array, nearest: bool = False) -> Index:
        """See `LocatedCells.cells_at`."""
        return self.cells.cells_at(turned_back(points, self.up), nearest)
