"""Static condensation of a block to its eight corners: exact for loads on the corners.

The condensed element has a dense stiffness of its own, which no eight moduli represent: 24 x 24
numbers a block, computed anew for every block.
"""

import numpy as np
from numpy.typing import ArrayLike

from carillon.arrays import Array
from carillon.fem.element import DEFAULT_POISSON
from carillon.numerics.simd import LANES, empty
from carillon.processes.threads import blas_threads
from dataset_gen.objectives.chen2015 import Corners, corners_of
from dataset_gen.objectives.compiled import compiled
from dataset_gen.objectives.elimination import TILE
from dataset_gen.objectives.kernel import (
    MOTIONS,
    WEIGHTS,
    assemble,
    copy_in,
    factorise,
    multiply,
    solve_lower,
    weigh,
)
from dataset_gen.objectives.patterns import straining_motions
from studies.blocks.block_error import pattern_rows


@compiled
def _flexibility(corners: Corners, young: Array, out: Array) -> None:
    """Z^T C K^+ C^T Z of each block, to `out` (n, 324)."""
    factor, stiffness, _ = corners.block
    size = 3 * len(factor.diagonal)
    weights, tiles = empty(WEIGHTS), empty(TILE * (len(stiffness.start) - 1))
    x, answer = empty(MOTIONS * size), empty(MOTIONS**2)
    for first in range(0, len(young), LANES):
        weigh(young, first, weights)
        assemble(stiffness, weights, tiles)
        copy_in(corners.loads, x)
        factorise(factor, tiles)
        solve_lower(factor, tiles, x, MOTIONS)
        columns = (x, 0, 1, MOTIONS)
        multiply(answer, columns, columns, MOTIONS, MOTIONS, size)
        for row in range(first, min(first + LANES, len(young))):
            for n in range(MOTIONS**2):
                out[row, n] = answer[n, row - first]


@blas_threads(1)
def corner_flexibility(young: ArrayLike, poisson: float = DEFAULT_POISSON) -> Array:
    """Flexibility (n, 18, 18) of blocks (n, 8) in the straining motions of their corners.

    Void corners follow the trilinear motion nearest to the active nodes. Where cells hinge, only
    the part of a load counts that the block can carry.
    """
    blocks = np.ascontiguousarray(young, dtype=float)
    flexibility = np.empty((len(blocks), MOTIONS, MOTIONS))
    for mask, rows in pattern_rows(blocks, len(blocks)):
        part = np.empty((len(rows), MOTIONS**2))
        _flexibility(corners_of(mask, poisson), blocks[rows], part)
        flexibility[rows] = part.reshape(-1, MOTIONS, MOTIONS)
    return flexibility


@blas_threads(1)
def condense(young: ArrayLike, poisson: float = DEFAULT_POISSON) -> Array:
    """Condensed stiffness (n, 24, 24) of blocks (n, 8), fine edge 1, in the unit of the moduli.

    It is the Schur complement of the block's stiffness on the corners' degrees of freedom.
    """
    motions = straining_motions()
    stiffness = np.linalg.inv(corner_flexibility(young, poisson))
    return np.asarray(motions @ stiffness @ motions.T)
