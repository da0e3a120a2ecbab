"""What is known of the eigenvalues of a solid.

Those so close that their modes may be mixed are one cluster: only the space they span is certain.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

WEYL_EXPONENT = 2.0 / 3.0
"""Exponent by which the eigenvalues of a compact body grow with their number."""
CLUSTER_GAP = 1e-3
"""Largest relative distance of neighbours in a cluster of eigenvalues."""


def clusters(values: Array, gap: float = CLUSTER_GAP) -> list[slice]:
    """Runs of ascending `values` whose neighbours are relatively closer than `gap`.

    Examples
    --------
    >>> clusters(np.array([1.0, 2.0, 2.0001, 3.0]))
    [slice(0, 1, None), slice(1, 3, None), slice(3, 4, None)]
    """
    breaks = np.flatnonzero(np.diff(values) > gap * values[1:]) + 1
    bounds = [0, *breaks.tolist(), len(values)]
    return [slice(start, stop) for start, stop in zip(bounds[:-1], bounds[1:], strict=True)]
