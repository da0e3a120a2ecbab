"""A density of the whole with which the moduli of a design are those of materials that exist.

Frequencies depend on moduli over density alone, so a factor common to both is free.  The loudness
of a design is its clips', whatever it weighs.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from carillon.limits import DENSITIES

Array = NDArray[np.float64]


def weight(moduli: Array, density: float, bounds: Sequence[float] | None) -> float:
    """Factor of moduli and density that brings the moduli within bounds, as near to 1 as may be.

    Where they differ by more than the bounds do, the geometric mean of their extremes becomes that
    of the bounds.  The density stays within what a solid may have.

    Parameters
    ----------
    moduli : (M,) [Pa]
        Of the cells.
    density : float [kg/m^3]
        Of the solid.
    bounds : (2,) [Pa] or None
        Lowest and highest modulus; 1 if there are none.

    Examples
    --------
    >>> weight(np.array([1e12, 4e13]), 1000.0, (1e9, 4e11))
    0.01
    >>> weight(np.array([2e9, 4e10]), 1000.0, (1e9, 4e11))
    1.0
    """
    if bounds is None:
        return 1.0
    least, most = bounds[0] / moduli.min(), bounds[1] / moduli.max()
    factor = np.clip(1.0, least, most) if least <= most else np.sqrt(least * most)
    return float(np.clip(factor, DENSITIES[0] / density, DENSITIES[1] / density))
