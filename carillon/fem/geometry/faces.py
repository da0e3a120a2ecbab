"""Which cells of a hexahedral mesh share a face, and which faces are open."""

import numba
import numpy as np

from carillon.fem.geometry.hanging import node_weights
from carillon.fem.geometry.hexmesh import HexMesh

FACE_CORNERS = np.array(
    [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]]
)
"""Local corners of the faces at -x, x, -y, y, -z and z, anticlockwise seen from outside."""


def face_neighbours(mesh: HexMesh) -> np.ndarray:
    """Pairs (p, 2) of cells that have the four nodes of a face in common, the lower one first.

    In a mixed mesh these include fine cells at the face of an element of twice the edge, whose
    corners they have for nodes there, and cells of one block that share a face, whatever hangs.
    """
    return np.concatenate([_neighbours_along(mesh, axis) for axis in range(3)])


def _neighbours_along(mesh: HexMesh, axis: int) -> np.ndarray:
    upper, lower = _face_nodes(mesh, 2 * axis + 1), _face_nodes(mesh, 2 * axis)
    return np.asarray(_matches(upper, lower, mesh.n_nodes + 1))


@numba.njit(cache=True, nogil=True)
def _matches(upper_sides, lower_sides, width):  # type: ignore[no-untyped-def]
    """Pairs (p, 2) of rows that are equal, of (m, 4) numbers below `width`; in ascending order."""
    count = len(upper_sides)
    start = np.zeros(width + 1, dtype=np.int64)
    for row in range(count):
        start[lower_sides[row, 0] + 1] += 1
    start = np.cumsum(start)
    filled = start[:-1].copy()
    rows = np.empty(count, dtype=np.int64)
    for row in range(count):
        first = lower_sides[row, 0]
        rows[filled[first]] = row
        filled[first] += 1
    pairs = np.empty((count, 2), dtype=np.int64)
    found = 0
    for upper in range(count):
        first = upper_sides[upper, 0]
        for place in range(start[first], start[first + 1]):
            lower = rows[place]
            same = True
            for corner in range(1, 4):
                same &= upper_sides[upper, corner] == lower_sides[lower, corner]
            if same:
                if found == len(pairs):
                    more = np.empty((2 * found, 2), dtype=np.int64)
                    more[:found] = pairs
                    pairs = more
                pairs[found] = upper, lower
                found += 1
    return pairs[:found].copy()


def boundary_faces(mesh: HexMesh) -> tuple[np.ndarray, np.ndarray]:
    """Quads (q, 4) int32 that no other cell shares, and the cell (q,) that each belongs to.

    Those of a large cell are among them if fine cells cover them in part.
    """
    quads, cells = [], []
    size = np.ones(mesh.n_cells) if mesh.span is None else mesh.span.astype(float) ** 2
    for axis in range(3):
        upper, lower = _neighbours_along(mesh, axis).T
        for face, own, beside in ((2 * axis, lower, upper), (2 * axis + 1, upper, lower)):
            covered = np.bincount(own, size[beside], minlength=mesh.n_cells)
            is_open = np.flatnonzero(covered < size)
            quads.append(mesh.cells[is_open][:, FACE_CORNERS[face]])
            cells.append(is_open)
    return np.concatenate(quads), np.concatenate(cells)


def corner_values(
    mesh: HexMesh, values: np.ndarray, quads: np.ndarray, cells: np.ndarray
) -> np.ndarray:
    """Values (q, 4, d) at the corners of the `boundary_faces`, from those (n, d) of the nodes."""
    if mesh.kinds is None:
        return np.asarray(values[quads])
    nodes = mesh.cells[cells]
    corner = (nodes[:, None, :] == quads[:, :, None]).argmax(axis=2)
    weights = node_weights()[mesh.kinds[cells][:, None], corner]
    return np.asarray(np.einsum("qck,qkd->qcd", weights, values[nodes]))


def surface_quads(mesh: HexMesh) -> np.ndarray:
    """Node indices (q, 4) int32 of the boundary faces, anticlockwise seen from outside."""
    return boundary_faces(mesh)[0]


def _face_nodes(mesh: HexMesh, face: int) -> np.ndarray:
    """Four ascending numbers (m, 4) that belong to each cell's face in a direction: its nodes.

    Where the ends of a face inside a block hang, cells on its two sides have other nodes for them;
    so there it is the node in the middle of the block and the quadrant about it.
    """
    nodes = np.sort(mesh.cells[:, FACE_CORNERS[face]], axis=1)
    if mesh.span is None:
        return nodes
    axis, side = divmod(face, 2)
    inner = np.flatnonzero((mesh.span == 1) & (mesh.grid[:, axis] & 1 != side))
    position = (mesh.grid[inner] & 1) @ np.array([1, 2, 4])
    nodes[inner] = mesh.n_nodes
    nodes[inner, 0] = mesh.cells[inner, position ^ 7]
    nodes[inner, 3] += position & ~(1 << axis)
    return nodes
