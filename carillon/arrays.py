"""Types of arrays and surfaces in annotations, and arrays that nobody changes."""

from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from trimesh import Trimesh as Surface  # Its import takes long; many commands need no surface.
else:
    Surface = Any

Array = NDArray[np.float64]
"""Array of numbers in double precision."""
Complex = NDArray[np.complex128]
"""Array of complex numbers in double precision."""
Integers = NDArray[np.integer]
"""Array of whole numbers of any length."""
Index = NDArray[np.int64]
"""Array of numbers of other things."""
Flags = NDArray[np.bool_]
"""Array of truth values."""

Table = TypeVar("Table", bound=NDArray[Any])


def frozen(table: Table) -> Table:
    """Make an array read-only, and return it."""
    table.setflags(write=False)
    return table
