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

from itertools import product

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Flags, Index

Indices = NDArray[np.integer]

INTERFACES = ("overlapping", "free", "fixed")
DEFAULT_INTERFACE = "overlapping"

_RANK_TOLERANCE = 1e-12


def restrict_stiffness(stiffness: Array, inside: Flags, interface: str, places: Index) -> Array:
    """Element stiffness (c, 3 k, 3 k) restricted to the nodes `inside` (c, k); others are zero.

    Restricting to all nodes returns the element itself; to none, zero. `places` (c, k, 3) are those
    of the nodes, see `Elements.node_places`. Raises ValueError for an unknown interface.
    """
    if interface not in INTERFACES:
        raise ValueError(f"interface {interface!r}, expected one of {INTERFACES}")
    keep = np.repeat(inside, 3, axis=1)
    if interface == "fixed":
        return np.asarray(stiffness * keep[:, :, None] * keep[:, None, :])
    restricted = np.zeros_like(stiffness)
    corners, every = inside.sum(axis=1), inside.shape[1]
    restricted[corners == every] = stiffness[corners == every]
    # Nodes on a line leave the element free to turn about it.
    turns = on_a_line(places, inside)
    # One node alone has no stiffness of its own.
    for count, turning in product(range(2, every), (False, True)):
        chosen = np.flatnonzero((corners == count) & (turns == turning))
        if len(chosen):
            # Unknowns to keep first, each cell in its own order.
            order = np.argsort(~keep[chosen], axis=1, kind="stable")
            kept, relaxed = order[:, : 3 * count], order[:, 3 * count :]
            schur = _schur(stiffness, chosen, kept, relaxed, turning)
            restricted[chosen[:, None, None], kept[:, :, None], kept[:, None, :]] = schur
    return restricted


def on_a_line(places: Index, inside: Flags) -> Flags:
    """Whether the nodes `inside` (c, k) each element, at `places` (c, k, 3), lie on one line."""
    element = np.arange(len(inside))
    apart = places - places[element, inside.argmax(axis=1)][:, None]
    apart[~inside] = 0
    farthest = np.abs(apart).sum(axis=2).argmax(axis=1)
    along = apart[element, farthest][:, None]
    return ~np.cross(apart, along).any(axis=(1, 2))


def _schur(
    matrices: Array, chosen: Indices, kept: Indices, relaxed: Indices, turning: bool
) -> Array:
    """Schur complements (c, k, k) of the `chosen` matrices onto the unknowns `kept` (c, k)."""
    cell = chosen[:, None, None]
    inner = matrices[cell, relaxed[:, :, None], relaxed[:, None, :]]
    coupling = matrices[cell, relaxed[:, :, None], kept[:, None, :]]
    if turning:
        relaxation = np.linalg.pinv(inner, rcond=_RANK_TOLERANCE, hermitian=True) @ coupling
    else:
        relaxation = np.linalg.solve(inner, coupling)
    schur = matrices[cell, kept[:, :, None], kept[:, None, :]]
    schur -= coupling.transpose(0, 2, 1) @ relaxation
    return np.asarray(0.5 * (schur + schur.transpose(0, 2, 1)))


def restrict_mass(mass: Array, inside: Flags) -> Array:
    """Nodal element mass (c, k, k) restricted to the nodes `inside`: the principal sub-matrix."""
    return np.asarray(mass * inside[:, :, None] * inside[:, None, :])
