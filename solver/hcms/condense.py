"""Element matrices restricted to the nodes that lie inside a group of subdomains.

Every interface treatment is a restriction of the elements that straddle a group's boundary:

`fixed`
    the principal sub-matrix, as Eq. (13) literally reads: nodes outside are held;
`free`
    the Schur complement: nodes outside are relaxed, so that every group is free-standing and keeps
    its rigid modes;
`overlapping`
    as `free`, but the modes of a subdomain are those of the body that it forms with the straddling
    elements in full, taken at its own nodes (see `solver.hcms.local`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.integer]

INTERFACES = ("overlapping", "free", "fixed")
DEFAULT_INTERFACE = "overlapping"

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
    corners = inside.sum(axis=1)
    restricted[corners == 8] = stiffness[corners == 8]
    # One corner alone has no stiffness of its own.
    for count in range(2, 8):
        chosen = np.flatnonzero(corners == count)
        if len(chosen):
            # Unknowns to keep first, each cell in its own order.
            order = np.argsort(~keep[chosen], axis=1, kind="stable")
            kept, relaxed = order[:, : 3 * count], order[:, 3 * count :]
            schur = _schur(stiffness, chosen, kept, relaxed)
            restricted[chosen[:, None, None], kept[:, :, None], kept[:, None, :]] = schur
    return restricted


def _schur(matrices: Array, chosen: Indices, kept: Indices, relaxed: Indices) -> Array:
    """Schur complements (c, k, k) of the `chosen` matrices onto the unknowns `kept` (c, k)."""
    cell = chosen[:, None, None]
    inner = matrices[cell, relaxed[:, :, None], relaxed[:, None, :]]
    coupling = matrices[cell, relaxed[:, :, None], kept[:, None, :]]
    if kept.shape[1] >= 3 * _NON_COLLINEAR:
        relaxation = np.linalg.solve(inner, coupling)
    else:
        # Two nodes leave the element free to turn about the line through them.
        relaxation = np.linalg.pinv(inner, rcond=_RANK_TOLERANCE, hermitian=True) @ coupling
    schur = matrices[cell, kept[:, :, None], kept[:, None, :]]
    schur -= coupling.transpose(0, 2, 1) @ relaxation
    return np.asarray(0.5 * (schur + schur.transpose(0, 2, 1)))


def restrict_mass(mass: Array, inside: NDArray[np.bool_]) -> Array:
    """Nodal element mass (c, 8, 8) restricted to the corners `inside`: the principal sub-matrix."""
    return np.asarray(mass * inside[:, :, None] * inside[:, None, :])
