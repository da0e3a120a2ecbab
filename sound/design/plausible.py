"""Density at which the moduli of a design are those of real materials.

Frequencies depend on moduli over density, so a factor common to both is free.  The loudness of a
design is that of its clips, whatever the density.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from carillon.arrays import Array
from carillon.limits import DENSITIES


def weight(moduli: Array, density: float, bounds: Sequence[float] | None) -> float:
    """Factor of moduli and density, nearest to 1, that brings the moduli within bounds.

    If the moduli span more than the bounds do, the geometric mean of their extremes becomes that of
    the bounds.  The density stays within `carillon.limits.DENSITIES`.

    Parameters
    ----------
    moduli : (M,) [Pa]
        Moduli of the cells.
    density : float [kg/m^3]
        Density of the solid.
    bounds : (2,) [Pa] or None
        Lowest and highest modulus; without bounds the factor is 1.

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
