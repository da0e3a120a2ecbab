"""A coarse model of which some blocks stay fine."""

import numpy as np

from carillon.arrays import Array, Index
from carillon.fem.geometry import Blocks, HexMesh, blocks_from_mesh, blocks_with_coarse
from carillon.fem.model import ElasticModel
from solver.coarsening.coarsening import Coarsening
from solver.coarsening.model import coarse_model, element_moduli

REMAINING = 0.4
"""Share of the allowed error at which refinement aims, if shares were errors."""


class RefinedModel:
    """A coarse model and which of its blocks stay fine.

    Parameters
    ----------
    coarsening
        Of the blocks that do not stay fine.
    mesh
        Coarse mesh to begin with, perhaps mixed; the plain one if it is none of this fine mesh.

    Attributes
    ----------
    fine, blocks
        The fine model; its blocks, some of which may be divided.
    is_given, is_fine_given
        Whether it began with the `mesh` given, and whether that is the fine mesh itself.
    """

    def __init__(
        self, fine: ElasticModel, coarsening: Coarsening, mesh: HexMesh | None = None
    ) -> None:
        self.fine = fine
        self._coarsening = coarsening
        self._plain = blocks_from_mesh(fine.mesh)
        given = None if mesh is None else blocks_with_coarse(fine.mesh, mesh)
        self.is_given = given is not None
        self.is_fine_given = mesh is not None and _is_same(mesh, fine.mesh)
        self.blocks = self._plain if given is None else given

    @property
    def young(self) -> Array:
        """Moduli (m,) [Pa] of the fine cells."""
        return self.fine.young[:, 0]

    @property
    def model(self) -> ElasticModel:
        """The model as it is now."""
        fine = self.fine
        moduli = element_moduli(
            self.blocks, self.young, self._coarsening, fine.regions, fine.cell_regions
        )
        return coarse_model(
            self.blocks,
            moduli,
            self._coarsening.lumped_fraction,
            self.fine.cell_regions,
            **self.fine.constants,
        )

    @property
    def n_dofs(self) -> int:
        """Unknowns of the model as it is now."""
        return self.blocks.coarse.n_dofs

    @property
    def fine_blocks(self) -> int:
        """Number of blocks that stay fine."""
        cells = self.blocks.coarse.grid[self.blocks.is_fine] >> 1
        return len(np.unique(cells, axis=0))

    @property
    def all_blocks(self) -> int:
        """Number of blocks."""
        return len(np.unique(self._plain.coarse.grid, axis=0))

    def refine(self, shares: Array, excess: float) -> None:
        """Keep fine the elements with the largest shares (mc,) of an error.

        `excess` is how many times as large as allowed the error is.
        """
        order = np.argsort(-shares, kind="stable")
        reached = np.cumsum(shares[order])
        left = REMAINING / excess
        count = 1 + int(np.searchsorted(reached, (1.0 - left) * reached[-1]))
        self.blocks = self._with_fine(order[:count])

    def refine_all(self) -> None:
        """Keep all blocks fine."""
        everything = np.ones(self._plain.coarse.n_cells, dtype=bool)
        self.blocks = blocks_from_mesh(self.fine.mesh, everything)

    def _with_fine(self, chosen: Index) -> Blocks:
        """The blocks with other elements fine beside those that are."""
        now, plain = self.blocks, self._plain
        fine = now.is_fine.copy()
        fine[chosen] = True
        cells = np.zeros(now.fine.n_cells, dtype=bool)
        cells[now.fine_of_block[fine][now.mask[fine]]] = True
        return blocks_from_mesh(now.fine, (cells[plain.fine_of_block] & plain.mask).any(axis=1))


def _is_same(left: HexMesh, right: HexMesh) -> bool:
    pairs = ((left.cells, right.cells), (left.node_grid, right.node_grid))
    return left.span is None and all(np.array_equal(*pair) for pair in pairs)
