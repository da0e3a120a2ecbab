"""What a sparse direct solver does when it is timed."""

from typing import Literal

from carillon.arrays import Array


class DirectSolver:
    """A factorisation in three steps, each of which may raise ConvergenceError."""

    order: Literal["C", "F"] = "F"
    """Memory order of blocks of right-hand sides."""
    first_factorises = False
    """Whether `analyse` cannot but factorise, too."""
    entries: int
    """Entries of the factor; known once it is there."""

    @property
    def operations(self) -> float | None:
        """Floating-point operations of a factorisation; None if the solver does not count."""
        return None

    def analyse(self) -> None:
        """Do what depends on the sparsity alone, if that can be had separately."""

    def factorise(self) -> None:
        """Factorise, for the first time or again."""
        raise NotImplementedError

    def solve(self, block: Array) -> Array:
        """Solutions (n, k) for a block of right-hand sides (n, k)."""
        raise NotImplementedError

    def destroy(self) -> None:
        """Free what Python does not."""
