"""Digital topology of voxel sets: solid connected through faces, void through faces and corners."""

import heapq
from functools import lru_cache
from itertools import product

import numpy as np

# A 3x3x3 neighbourhood is an integer with one bit per position.
_POSITIONS = np.array(list(product((-1, 0, 1), repeat=3)))


def _around(position: np.ndarray, steps: tuple[int, ...]) -> int:
    """Positions as many unit steps away, along different axes, as `steps` lists."""
    offset = np.abs(_POSITIONS - position)
    there = (offset.max(axis=1) == 1) & np.isin(offset.sum(axis=1), steps)
    return sum(1 << int(bit) for bit in np.flatnonzero(there))


_CENTRE = np.zeros(3, dtype=int)
_SIX = _around(_CENTRE, (1,))
_EIGHTEEN = _around(_CENTRE, (1, 2))
_TWENTY_SIX = _around(_CENTRE, (1, 2, 3))
_BY_FACE = tuple(_around(position, (1,)) for position in _POSITIONS)
_BY_CORNER = tuple(_around(position, (1, 2, 3)) for position in _POSITIONS)


def pieces(filled: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Label the face-connected pieces of `filled`, largest first, and count their voxels.

    Labels (nx, ny, nz) are 0 outside, 1 in the largest piece, and so on (ties: first in the grid).
    """
    from scipy import ndimage  # Its import takes long.

    raw, count = ndimage.label(filled)
    sizes = np.bincount(raw.ravel(), minlength=count + 1)[1:]
    order = np.argsort(-sizes, kind="stable")
    rank = np.zeros(count + 1, dtype=np.int32)
    rank[1:][order] = np.arange(1, count + 1)
    return rank[raw], sizes[order]


@lru_cache(maxsize=1 << 18)
def is_simple(neighbourhood: int) -> bool:
    """Whether removing the centre of a 3x3x3 set changes neither pieces, tunnels nor cavities.

    The solid is connected through faces and the void through corners: the centre is simple if it
    touches exactly one piece of the solid among its 18 neighbours, and exactly one piece of the
    void among its 26 (Bertrand and Malandain 1994). `neighbourhood`: bit ``9*x + 3*y + z`` tells
    whether position (x, y, z) in 0..2 is solid.

    Examples
    --------
    >>> end_of_a_line = 1 << 4
    >>> middle_of_a_line = 1 << 4 | 1 << 22
    >>> is_simple(end_of_a_line), is_simple(middle_of_a_line), is_simple(0)
    (True, False, False)
    """
    solid = neighbourhood & _EIGHTEEN
    touching = solid & _SIX
    if touching == 0 or touching & ~_grown(touching & -touching, solid, _BY_FACE):
        return False
    void = ~neighbourhood & _TWENTY_SIX
    return void != 0 and _grown(void & -void, void, _BY_CORNER) == void


def _grown(seed: int, within: int, neighbours: tuple[int, ...]) -> int:
    """Piece of `within` that contains the position `seed`."""
    piece = front = seed
    while front:
        lowest = front & -front
        fresh = neighbours[lowest.bit_length() - 1] & within & ~piece
        piece |= fresh
        front = (front ^ lowest) | fresh
    return piece


def thin_to(cover: np.ndarray, keep: np.ndarray, rank: np.ndarray) -> np.ndarray:
    """Remove voxels of `cover` outside `keep` as long as no piece, tunnel or cavity comes or goes.

    Parameters
    ----------
    cover, keep : (nx, ny, nz) bool
        With `keep` inside `cover`.
    rank : (nx, ny, nz)
        Voxels of lowest rank go first; ties in grid order.
    """
    shape = tuple(size + 2 for size in cover.shape)
    stride = np.array([shape[1] * shape[2], shape[2], 1])
    around = [int(offset) for offset in _POSITIONS @ stride]
    # Flat Python sequences: single elements of numpy arrays are slow to reach.
    solid = bytearray(np.pad(cover, 1).tobytes())
    removable = bytearray(np.pad(cover & ~keep, 1).tobytes())
    candidates = np.flatnonzero(np.pad(cover & ~keep, 1))
    ranks = dict(zip(candidates.tolist(), np.pad(rank, 1).ravel()[candidates].tolist()))
    queue = [(value, voxel) for voxel, value in ranks.items()]
    heapq.heapify(queue)
    while queue:
        _, voxel = heapq.heappop(queue)
        if not solid[voxel]:
            continue
        neighbourhood = 0
        for bit, offset in enumerate(around):
            neighbourhood |= solid[voxel + offset] << bit
        if not is_simple(neighbourhood):
            continue
        solid[voxel] = removable[voxel] = 0
        # Neighbours that had to stay may be free to go now.
        for offset in around:
            if removable[voxel + offset]:
                heapq.heappush(queue, (ranks[voxel + offset], voxel + offset))
    thinned = np.frombuffer(bytes(solid), dtype=bool).reshape(shape)
    return thinned[1:-1, 1:-1, 1:-1].copy()
