"""Fine nodes that hang where fine cells meet coarse elements."""

from __future__ import annotations

import numpy as np

from carillon.fem.geometry.hexmesh import HexMesh


def hanging_nodes(fine: HexMesh, position: np.ndarray, divided: np.ndarray) -> np.ndarray:
    """Which nodes (n,) of the fine mesh hang: what a coarse element says there holds.

    Parameters
    ----------
    fine
        The fine mesh.
    position : (m,)
        Position of each cell in its block.
    divided : (m,) bool
        Whether it stays in the mesh, since its block is divided.
    """
    beside = np.zeros(fine.n_nodes, dtype=bool)
    beside[fine.cells[~divided]] = True
    kept = np.zeros(fine.n_nodes, dtype=bool)
    kept[fine.cells[divided]] = True
    hanging = beside & kept & (fine.node_grid & 1).any(axis=1)
    # The middle of a face is the mean of its corners: the edges of every cell there hang as well.
    # They draw no other face along, so once is enough.
    cells, corner = fine.cells[divided], position[divided]
    own = np.arange(len(cells))
    for a, b in ((1, 2), (1, 4), (2, 4)):
        follow = hanging[cells[own, corner ^ a ^ b]]
        for edge in (a, b):
            hanging[cells[own, corner ^ edge][follow]] = True
    return hanging


def hanging_corners(hanging: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Masks (c,) uint8 of the corners of `cells` (c, 8) that are nodes which hang."""
    return np.packbits(hanging[cells], axis=1, bitorder="little").ravel()
