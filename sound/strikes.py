"""Struck points of a surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Strike:
    """A named point of the surface that is struck.

    Attributes
    ----------
    name
        Of the target whose clip is to sound there.
    vertex
        Number of the surface's vertex.
    position
        (3,) [m].
    inward
        (3,) unit vector into the solid.
    """

    name: str
    vertex: int
    position: Array
    inward: Array
