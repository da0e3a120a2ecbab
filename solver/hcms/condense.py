"""Element matrices restricted to the nodes that lie inside a group of subdomains.

Both interface treatments are a restriction of the elements that straddle a group's boundary:

`fixed`
    the principal sub-matrix, as Eq. (13) literally reads: nodes outside are held;
`free`
    the Schur complement: nodes outside are relaxed, so that every group is free-standing and keeps
    its rigid modes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

INTERFACES = ("free", "fixed")

_RANK_TOLERANCE = 1e-12
_NON_COLLINEAR = 3


def restrict_stiffness(stiffness: Array, inside: NDArray[np.bool_], interface: str) -> Array:
    """Element stiffness (c, 24, 24) restricted to the corners `inside` (c, 8); other rows are zero.

    Restricting to all corners returns the element itself; to none, zero.
    """
    if interface not in INTERFACES:
        raise ValueError(f"interface {interface!r}, expected one of {INTERFACES}")
    keep = np.repeat(inside, 3, axis=1)
    if interface == "fixed":
        return np.asarray(stiffness * keep[:, :, None] * keep[:, None, :])
    restricted = np.zeros_like(stiffness)
    pattern = np.packbits(inside, axis=1, bitorder="little").ravel()
    for code in np.unique(pattern):
        chosen = np.flatnonzero(pattern == code)
        kept = np.flatnonzero(keep[chosen[0]])
        relaxed = np.flatnonzero(~keep[chosen[0]])
        if len(relaxed) == 0:
            restricted[chosen] = stiffness[chosen]
        elif len(kept) > 3:
            restricted[np.ix_(chosen, kept, kept)] = _schur(stiffness[chosen], kept, relaxed)
    return restricted


def _schur(matrices: Array, kept: NDArray[np.integer], relaxed: NDArray[np.integer]) -> Array:
    inner = matrices[:, relaxed[:, None], relaxed]
    coupling = matrices[:, relaxed[:, None], kept]
    if len(kept) >= 3 * _NON_COLLINEAR:
        relaxation = np.linalg.solve(inner, coupling)
    else:
        # Two nodes leave the element free to turn about the line through them.
        relaxation = np.linalg.pinv(inner, rcond=_RANK_TOLERANCE, hermitian=True) @ coupling
    schur = matrices[:, kept[:, None], kept] - coupling.transpose(0, 2, 1) @ relaxation
    return np.asarray(0.5 * (schur + schur.transpose(0, 2, 1)))


def restrict_mass(mass: Array, inside: NDArray[np.bool_]) -> Array:
    """Nodal element mass (c, 8, 8) restricted to the corners `inside`: the principal sub-matrix."""
    return np.asarray(mass * inside[:, :, None] * inside[:, None, :])
