"""Gaps of a surface that its voxels close, so that they hold together what is apart.

Gaps narrower than a voxel close, and of wider ones voxels that are less than half full may stay in
a slit that would part the voxels otherwise. Sample points tell such joints: two voxels share a
face, no points inside the surface are beside each other across it, and none lead from one voxel to
the other near it. Gaps narrower than about 0.6 voxels may lie between two such points unseen.
"""

from itertools import product

import numpy as np

from carillon.arrays import Array, Flags, Index, Surface
from carillon.command_line.logs import warn_once
from carillon.fem.geometry.fill import SAMPLES
from carillon.fem.geometry.grid import Grid
from carillon.fem.geometry.samples import SamplePoints
from carillon.fem.geometry.touching import touched_voxels
from carillon.fem.geometry.voxels import VoxelModel

NEAR = 4
"""Voxels around a joint within which points inside may lead from one side to the other."""
LEAST_FULL = 0.7
"""Mean share of a voxel inside the surface below which walls are so thin that points miss them."""
MOST_JOINTS = 200
"""Joints that are looked at."""


def say_bridged(surface: Surface, voxels: VoxelModel) -> None:
    """Warn of a gap of the surface that the voxels close."""
    joint = bridge(surface, voxels)
    if joint is not None:
        at = ", ".join(f"{x:.3g}" for x in joint)
        warn_once(
            f"mesh {voxels.name!r}: voxels close a gap near ({at}) m and hold together what is "
            "apart; raise the resolution, or use --discretisation finite-cell"
        )


def bridge(surface: Surface, voxels: VoxelModel) -> Array | None:
    """Middle (3,) [m] of a face across which voxels join what is apart; None if there is none.

    `surface`: triangles in metres, whose voxels they are.
    """
    filled, inside = voxels.filled, _inside(surface, voxels)
    if inside.sum() < LEAST_FULL * SAMPLES**3 * voxels.n_cells:
        return None
    joints = [(axis, voxel) for axis in range(3) for voxel in _joints(filled, inside, axis)]
    for axis, voxel in joints[:: -(-len(joints) // MOST_JOINTS) or 1]:
        if _is_bridge(filled, inside, voxel, axis):
            middle = voxel + 0.5
            middle[axis] += 0.5
            return np.asarray(voxels.origin + voxels.edge * middle)
    return None


def _inside(surface: Surface, voxels: VoxelModel) -> Flags:
    """Whether the sample points of filled voxels, along each axis, are inside the surface."""
    grid = Grid(voxels.origin, voxels.edge, voxels.shape)
    touched = touched_voxels(surface, grid)
    inside = voxels.filled
    for axis in range(3):
        inside = np.repeat(inside, SAMPLES, axis=axis)
    # A filled voxel that the surface does not touch is full.
    near = np.argwhere(touched & voxels.filled)
    samples = SamplePoints(surface, grid, SAMPLES)
    index = samples.of_voxels(near)
    inside[tuple(index.T)] = samples.inside(index)
    return inside


def _joints(filled: Flags, inside: Flags, axis: int) -> Index:
    """Voxels (k, 3) that share with the next along an axis a face with no points inside across."""
    first = np.moveaxis(filled, axis, 0)
    voxels = np.argwhere(first[:-1] & first[1:])
    points = np.pad(np.moveaxis(inside, axis, 0), [(0, 0), (1, 1), (1, 1)])
    joined = np.zeros(len(voxels), dtype=bool)
    x, y, z = SAMPLES * voxels.T
    x = x + SAMPLES - 1
    for j, k in product(range(SAMPLES), repeat=2):
        before = points[x, y + j + 1, z + k + 1]
        for dj, dk in product((0, 1, 2), repeat=2):
            joined |= before & points[x + 1, y + j + dj, z + k + dk]
    return voxels[~joined][:, np.argsort([axis, *(other for other in range(3) if other != axis)])]


def _is_bridge(filled: Flags, inside: Flags, voxel: Index, axis: int) -> bool:
    """Whether no points inside lead from a voxel to the next along an axis, near the two."""
    from scipy import ndimage  # Its import takes long.

    step = np.eye(3, dtype=np.int64)[axis]
    low = np.maximum(voxel - NEAR, 0)
    high = np.minimum(voxel + step + NEAR + 1, filled.shape)
    window = tuple(slice(SAMPLES * a, SAMPLES * b) for a, b in zip(low, high))
    label = ndimage.label(inside[window], np.ones((3, 3, 3)))[0]

    def held(first: Index, step: Index) -> set[int]:
        """Labels in a voxel, or in the one behind it if it holds no points inside."""
        for place in (first, first + step):
            if (place < low).any() or (place >= high).any() or not filled[tuple(place)]:
                return set()
            start = SAMPLES * (place - low)
            own = np.unique(label[tuple(slice(at, at + SAMPLES) for at in start)])
            if own.any():
                return set(own[own > 0].tolist())
        return set()

    one, other = held(voxel, -step), held(voxel + step, step)
    return bool(one) and bool(other) and not one & other
