"""Cells that points lie in: those of meshes and of grids, whatever is known of them."""

from abc import ABC, abstractmethod

from carillon.arrays import Array, Index


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
