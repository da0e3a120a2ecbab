"""Operations of the error correction, counted from sizes alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from carillon.fem.elements import Elements
from carillon.fem.model import Solid
from solver.assembly.node_rows import Pattern
from solver.hcms.counts import eigen_flops, product_flops
from solver.linear.dissection import dissect

LOOKS = 3
"""Dense eigenproblems of the Krylov space that a correction solves."""


@dataclass(frozen=True)
class Factorisation:
    """A sparse Cholesky factorisation by nested dissection.

    Attributes
    ----------
    flops
        Operations of the factorisation.
    entries
        Entries of the factor.
    boundary
        Unknowns on the boundary of the largest front, level by level from the root.
    """

    flops: float
    entries: float
    boundary: tuple[float, ...]

    def grown(self, factor: float) -> Factorisation:
        """That of a compact solid `factor` times as large."""
        return Factorisation(
            self.flops * factor**2,
            self.entries * factor ** (4.0 / 3.0),
            tuple(size * factor ** (2.0 / 3.0) for size in self.boundary),
        )

    def solve_flops(self, columns: float) -> float:
        """Operations of a solve with so many right-hand sides."""
        return 4.0 * self.entries * columns

    def update_bytes(self, levels: int) -> float:
        """Bytes of the updates that the fronts of the uppermost `levels` send to their parents."""
        return sum(4.0 * size * (size + 1.0) for size in self.boundary[1 : levels + 1])

    def solve_bytes(self, levels: int, columns: float) -> float:
        """Bytes of right-hand sides that pass these fronts, up and down."""
        return sum(16.0 * size * columns for size in self.boundary[1 : levels + 1])


def assembly_flops(elements: Elements) -> float:
    """Operations of the stiffness of elements: a matrix for each point, scaled and added."""
    points, nodes = elements.young.shape[1], elements.node_places.shape[1]
    return 2.0 * len(elements) * points * (3 * nodes) ** 2


def elimination(model: Solid) -> Factorisation:
    """Symbolic factorisation of the stiffness of a solid."""
    mesh, steps = model.mesh, model.elements.steps
    pattern = Pattern.of_cells(model.connectivity.astype(np.int64), 0, mesh.n_nodes)
    fronts = dissect(mesh.node_grid.astype(np.int64), pattern.indptr, pattern.columns, steps)
    own = 3.0 * np.diff(fronts.first)
    outside = 3.0 * np.array([len(boundary) for boundary in fronts.boundary])
    flops = own**3 / 3.0 + own**2 * outside + own * outside**2
    depth = np.zeros(len(fronts), dtype=int)
    for front in reversed(range(len(fronts))):
        if fronts.parent[front] >= 0:
            depth[front] = depth[fronts.parent[front]] + 1
    boundary = tuple(float(outside[depth == level].max()) for level in range(int(depth.max()) + 1))
    return Factorisation(
        float(flops.sum()), float((0.5 * own * (own + 1.0) + own * outside).sum()), boundary
    )


def dense_flops(unknowns: float, blocks: int, solves: int, width: int) -> tuple[float, float]:
    """Operations of the block Lanczos iteration: those shared by the ranks, and those of rank 0.

    Every block is projected on the basis and freed of it, then made orthonormal; twice the
    operator's Ritz values are looked at, and in the end the modes are formed.

    Parameters
    ----------
    unknowns
        Of the whole solid.
    blocks, solves
        Blocks of right-hand sides and their columns in all.
    width
        Vectors formed.
    """
    if blocks == 0:
        return 0.0, 0.0
    columns = solves / blocks
    basis = 2.0 * unknowns * solves**2
    orthonormal = 6.0 * unknowns * columns * solves
    vectors = product_flops(round(unknowns), solves, width)
    return basis + orthonormal + vectors, LOOKS * eigen_flops(solves, False)
