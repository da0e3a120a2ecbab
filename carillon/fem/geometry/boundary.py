"""The faces between a hexahedral mesh and the outside."""

from __future__ import annotations

import numpy as np

from carillon.fem.geometry.hexmesh import HexMesh

#: Local corners of the six faces of a cell, anticlockwise seen from outside, and the direction
#: each of them looks in.
FACE_CORNERS = np.array(
    [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]]
)
FACE_DIRECTIONS = np.array(
    [[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]], dtype=np.int64
)


def surface_quads(mesh: HexMesh) -> np.ndarray:
    """Node indices (q, 4) int32 of the boundary faces, anticlockwise seen from outside."""
    return boundary_faces(mesh)[0]


def boundary_faces(mesh: HexMesh) -> tuple[np.ndarray, np.ndarray]:
    """Boundary quads and the cell that each belongs to."""
    grid = mesh.grid.astype(np.int64) - mesh.grid.min(axis=0) + 1
    size = grid.max(axis=0) + 2
    filled = np.zeros(size, dtype=bool)
    filled[tuple(grid.T)] = True
    quads, cells = [], []
    for corners, direction in zip(FACE_CORNERS, FACE_DIRECTIONS, strict=True):
        open_cells = np.flatnonzero(~filled[tuple((grid + direction).T)])
        quads.append(mesh.cells[open_cells][:, corners])
        cells.append(open_cells)
    return np.concatenate(quads), np.concatenate(cells)
