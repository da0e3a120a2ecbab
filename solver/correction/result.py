"""The result of an error correction."""

from __future__ import annotations

from dataclasses import dataclass, field

from carillon.arrays import Array
from solver.linear import Lasting


@dataclass
class Correction:
    """Corrected eigenpairs of the elastic modes.

    Attributes
    ----------
    values
        (k,) Ritz values [rad^2/s^2], ascending.
    vectors
        (local, k) mass-orthonormal, orthogonal to the rigid motions, row-major.
    errors
        (k,) estimated relative error of each value, from its residual.
    guard
        (local, g) what the iteration carried beyond; useful to start again from.
    steps
        Number of corrections made.
    solves, blocks
        Number of right-hand sides solved, and of the blocks that they came in.
    history
        Largest estimated error before each step, and at the end.
    inverse
        Inverse for this material that a similar one may start with; None if there is none to keep.
    """

    values: Array
    vectors: Array
    errors: Array
    guard: Array
    steps: int = 0
    solves: int = 0
    blocks: int = 0
    history: list[float] = field(default_factory=list)
    inverse: Lasting | None = None
