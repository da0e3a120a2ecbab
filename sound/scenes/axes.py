"""Upward axis of mesh files: z in a scene, y in glTF (glTF 2.0, section 3.4)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

Y_UP = (".gltf", ".glb")
"""Endings of mesh files whose y points up.  In all other files z is taken to point up."""
_Y_TO_Z = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


def upright(mesh: str) -> Array | None:
    """Rotation (3, 3) from the coordinates of a mesh file to axes whose z points up, None if none.

    Examples
    --------
    >>> upright("bar.GLB") @ [0.0, 1.0, 0.0]
    array([0., 0., 1.])
    >>> upright("bar.obj") is None
    True
    """
    return _Y_TO_Z if Path(mesh).suffix.lower() in Y_UP else None
