"""Types of arrays in annotations."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Array of numbers in double precision."""
Complex = NDArray[np.complex128]
"""Array of complex numbers in double precision."""
Integers = NDArray[np.integer]
"""Array of whole numbers of any length."""
