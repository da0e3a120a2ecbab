"""The result of an error correction."""

from dataclasses import dataclass, field

from carillon.arrays import Array
from solver.linear import Lasting


@dataclass
class Correction:
    """Corrected eigenpairs of the elastic modes."""

    values: Array
    """(k,) Ritz values [rad^2/s^2], ascending."""
    vectors: Array
    """(local, k) mass-orthonormal, orthogonal to the rigid motions, row-major."""
    errors: Array
    """(k,) estimated relative error of each value, from its residual."""
    guard: Array
    """(local, g) what the iteration carried beyond; useful to start again from."""
    steps: int = 0
    """Number of corrections made."""
    solves: int = 0
    blocks: int = 0
    """Number of right-hand sides solved, and of the blocks that they came in."""
    history: list[float] = field(default_factory=list)
    """Largest estimated error before each step, and at the end."""
    inverse: Lasting | None = None
    """Inverse for this material that a similar one may start with; None if there is none to
    keep."""
