"""Which cells of a hexahedral mesh share a face, and which faces are open."""

from __future__ import annotations

import numpy as np

from carillon.fem.geometry.hexmesh import HexMesh

DIRECTIONS = np.array(
    [[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]], dtype=np.int64
)
"""Directions that the six faces of a cell look in."""

FACE_CORNERS = np.array(
    [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]]
)
"""Local corners of the faces, anticlockwise seen from outside."""


def face_neighbours(mesh: HexMesh) -> np.ndarray:
    """Pairs (p, 2) of cells that have the four nodes of a face in common, the lower one first."""
    pairs = []
    for below, above in FACE_CORNERS.reshape(3, 2, 4):
        upper_side, lower_side = _face_numbers(mesh, above, below)
        order = np.argsort(lower_side, kind="stable")
        begin = np.searchsorted(lower_side[order], upper_side, side="left")
        count = np.searchsorted(lower_side[order], upper_side, side="right") - begin
        first = np.repeat(np.arange(mesh.n_cells), count)
        step = np.arange(len(first)) - np.repeat(np.cumsum(count) - count, count)
        pairs.append(np.column_stack([first, order[begin[first] + step]]))
    return np.concatenate(pairs)


def boundary_faces(mesh: HexMesh) -> tuple[np.ndarray, np.ndarray]:
    """Quads (q, 4) int32 that no other cell shares, and the cell (q,) that each belongs to."""
    quads, cells = [], []
    for face, corners in enumerate(FACE_CORNERS):
        own, opposite = _face_numbers(mesh, corners, FACE_CORNERS[face ^ 1])
        is_open = np.flatnonzero(~np.isin(own, opposite))
        quads.append(mesh.cells[is_open][:, corners])
        cells.append(is_open)
    return np.concatenate(quads), np.concatenate(cells)


def surface_quads(mesh: HexMesh) -> np.ndarray:
    """Node indices (q, 4) int32 of the boundary faces, anticlockwise seen from outside."""
    return boundary_faces(mesh)[0]


def _face_numbers(mesh: HexMesh, *faces: np.ndarray) -> np.ndarray:
    """Numbers (len(faces), m) of the cells' faces with these local corners: equal if one face."""
    nodes = np.concatenate([np.sort(mesh.cells[:, corners], axis=1) for corners in faces])
    first, second, third, fourth = nodes.astype(np.int64).T
    numbers = _paired(_paired(first, second), _paired(third, fourth))
    return numbers.reshape(len(faces), mesh.n_cells)


def _paired(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """One number for each distinct pair of numbers."""
    pairs = left * (int(right.max(initial=0)) + 1) + right
    return np.asarray(np.unique(pairs, return_inverse=True)[1].ravel())
