"""Products of a rank's rows of a sparse matrix of small blocks with blocks of vectors.

PETSc multiplies a sparse matrix with column-major blocks; here blocks are row-major, so that one
entry of the matrix meets whole rows of the block, which is several times faster, and the rows that
a rank needs of others travel in one message a neighbour.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array, Index
from carillon.numerics.simd_width import LANES
from carillon.processes.threads import in_parallel, split
from solver.assembly.halo import Halo
from solver.assembly.row_kernels import multiply

NODES_AT_ONCE = 256
"""Number of nodes whose rows of a product exist at once where they are used up one by one."""


@dataclass(frozen=True)
class RowProducts:
    """Rows of a sparse matrix of blocks, three unknowns a node.

    Parameters
    ----------
    graph
        Compressed rows: where each begins (nodes + 1,), and the columns (e,): this rank's nodes,
        counted from 0, then those of others, ascending within a row.
    entries
        (e, b, b) blocks along the graph. Of b = 1, the same number for the three unknowns.
    halo
        Exchange of the columns of others; None if there are none.
    """

    graph: tuple[Index, Index]
    entries: Array
    halo: Halo | None = None
    threads: int = 1

    @property
    def nodes(self) -> int:
        """Number of rows, one a node."""
        return len(self.graph[0]) - 1

    def times(self, block: Array) -> Array:
        """Product (3 nodes, k) with a row-major block (3 local columns, k); collective.

        The block may be columns of a wider one, here and below.
        """
        width = block.shape[1]
        block, ghosts = self._with_ghosts(block)
        result = np.empty((3 * self.nodes, block.shape[1]))

        def rows(start: int, stop: int) -> None:
            self._multiply(start, stop, block, ghosts, result[3 * start : 3 * stop])

        in_parallel(rows, self._ranges(), self.threads)
        return result if width >= LANES else np.ascontiguousarray(result[:, :width])

    def by_rows(self, block: Array, work: Callable[[slice, Array], None]) -> None:
        """Call `work` with some rows and the product there (3 r, k), until it had all rows.

        Collective. It may run in several threads at once, and must not change the block, whose
        width k is at least `LANES`.
        """
        block, ghosts = self._with_ghosts(block)

        def rows(start: int, stop: int) -> None:
            for here, few in self._pieces(start, stop, block, ghosts):
                work(here, few)

        in_parallel(rows, self._ranges(), self.threads)

    def projected(self, left: Array, right: Array) -> Array:
        """This rank's part of left^T A right (l, r), for blocks (3 nodes, l or r); collective."""
        width = right.shape[1]
        right, ghosts = self._with_ghosts(right)

        def rows(start: int, stop: int) -> Array:
            # Of the two products of row-major blocks, the one that BLAS makes faster.
            total = np.zeros((right.shape[1], left.shape[1]))
            for here, few in self._pieces(start, stop, right, ghosts):
                total += few.T @ left[here]
            return total

        none = np.zeros((right.shape[1], left.shape[1]))
        total = sum(in_parallel(rows, self._ranges(), self.threads), none)
        return np.ascontiguousarray(total[:width].T)

    def _ranges(self) -> list[tuple[int, int]]:
        return split(self.nodes, self.threads, max(self.nodes, 1))

    def _pieces(
        self, start: int, stop: int, block: Array, ghosts: Array
    ) -> Iterator[tuple[slice, Array]]:
        """Rows and the product there, a few nodes at a time."""
        image = np.empty((3 * min(NODES_AT_ONCE, stop - start), block.shape[1]))
        for first in range(start, stop, NODES_AT_ONCE):
            last = min(first + NODES_AT_ONCE, stop)
            few = image[: 3 * (last - first)]
            self._multiply(first, last, block, ghosts, few)
            yield slice(3 * first, 3 * last), few

    def _with_ghosts(self, block: Array) -> tuple[Array, Array]:
        """A row-major block that fills a register, and the rows of others; collective."""
        width = block.shape[1]
        if block.strides[1] != block.itemsize:
            block = np.ascontiguousarray(block)
        if width < LANES:
            narrow, block = block, np.zeros((len(block), LANES))
            block[:, :width] = narrow
        return block, block[:0] if self.halo is None else self.halo.exchange(block)

    def _multiply(self, start: int, stop: int, block: Array, ghosts: Array, result: Array) -> None:
        """Rows (3 (stop - start), k) of the product for the nodes [start, stop)."""
        indptr, columns = self.graph
        rows, components = (indptr[start : stop + 1], columns), 3 // self.entries.shape[1]
        multiply((0, stop - start), rows, self.entries, block, ghosts, result, components)
