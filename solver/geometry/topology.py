"""Digital topology of voxel sets: solid connected through faces, void through faces and corners."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

FACES = ndimage.generate_binary_structure(3, 1)
CORNERS = ndimage.generate_binary_structure(3, 3)

_WITHOUT_CENTRE = CORNERS.copy()
_WITHOUT_CENTRE[1, 1, 1] = False
_EIGHTEEN = ndimage.generate_binary_structure(3, 2) & _WITHOUT_CENTRE
_SIX = FACES & _WITHOUT_CENTRE


def pieces(filled: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Label the face-connected pieces of `filled`, largest first.

    Returns
    -------
    labels : like `filled`, 0 outside, 1 for the largest piece, and so on (ties: first in the grid).
    sizes : (n_pieces,) voxels in each piece, descending.
    """
    raw, count = ndimage.label(filled, structure=FACES)
    sizes = np.bincount(raw.ravel(), minlength=count + 1)[1:]
    order = np.argsort(-sizes, kind="stable")
    rank = np.zeros(count + 1, dtype=np.int32)
    rank[1:][order] = np.arange(1, count + 1)
    return rank[raw], sizes[order]


def is_simple(neighbourhood: np.ndarray) -> bool:
    """Whether removing the centre of a 3x3x3 set changes neither pieces, tunnels nor cavities.

    The solid is 6-connected and the void 26-connected: the centre is simple if it touches exactly
    one piece of the solid among its 18 neighbours, and exactly one piece of the void among its 26
    (Bertrand and Malandain 1994).
    """
    solid, count = ndimage.label(neighbourhood & _EIGHTEEN, structure=FACES)
    if count == 0 or len(np.unique(solid[_SIX & neighbourhood])) != 1:
        return False
    return ndimage.label(~neighbourhood & _WITHOUT_CENTRE, structure=CORNERS)[1] == 1


def thin_to(cover: np.ndarray, keep: np.ndarray, rank: np.ndarray) -> np.ndarray:
    """Remove voxels of `cover` outside `keep` as long as the topology of `cover` is unchanged.

    Parameters
    ----------
    cover, keep : (nx, ny, nz) bool, with `keep` inside `cover`.
    rank : (nx, ny, nz), voxels of lowest rank go first; ties in grid order.

    Returns
    -------
    Set between `keep` and `cover` with the pieces, tunnels and cavities of `cover`.
    """
    solid = np.pad(cover, 1)
    queue = np.argwhere(cover & ~keep)
    queue = queue[np.argsort(rank[tuple(queue.T)], kind="stable")]
    while True:
        left = []
        for x, y, z in queue:
            if is_simple(solid[x : x + 3, y : y + 3, z : z + 3]):
                solid[x + 1, y + 1, z + 1] = False
            else:
                left.append((x, y, z))
        if len(left) in (0, len(queue)):
            return solid[1:-1, 1:-1, 1:-1].copy()
        queue = np.array(left)
