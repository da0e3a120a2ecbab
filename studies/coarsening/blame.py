"""Which elements make single modes wrong, and where those have their energy."""

from typing import Any

import numpy as np

from carillon.arrays import Array
from carillon.fem.geometry import Blocks
from carillon.fem.model import ElasticModel
from solver.refinement.estimate import element_energies, error_shares, fine_energies

LISTED = 10
"""Elements that are named for each mode."""


class Blame:
    """Energies and shares of the error of some modes of the fine solid, element by element.

    Parameters
    ----------
    blocks, coarse, fine
        The coarse mesh, plain or mixed, the model on it, and the fine one.
    values, vectors
        (k,) eigenvalues and (n_dofs, k) mass-normalised modes of the fine solid.

    Attributes
    ----------
    energy : (mc, k)
        Share of the mode's strain energy in each element.
    shares : (mc, k)
        Relative error of the mode's eigenvalue by each element, see `error_shares`.
    cell_energy : (m, k)
        Share of the strain energy in each fine cell.
    """

    def __init__(
        self,
        blocks: Blocks,
        coarse: ElasticModel,
        fine: ElasticModel,
        values: Array,
        vectors: Array,
    ) -> None:
        self._blocks = blocks
        self.energy = fine_energies(blocks, fine, vectors) / values
        self.cell_energy = element_energies(fine, vectors) / values
        self.shares = error_shares(blocks, coarse, fine, values, vectors)

    @property
    def blamed(self) -> Array:
        """Share (mc, k) of all errors of a mode, whatever their sign, in each element."""
        size = np.abs(self.shares)
        return np.asarray(size / np.maximum(size.sum(axis=0), np.finfo(float).tiny))

    def cell_blamed(self, mode: int) -> Array:
        """The same (m,) in each fine cell, an element's spread over its cells evenly."""
        element, position = np.nonzero(self._blocks.mask)
        filled = self._blocks.mask.sum(axis=1)
        cells = np.empty(self._blocks.fine.n_cells)
        cells[self._blocks.fine_of_block[element, position]] = (
            self.blamed[element, mode] / filled[element]
        )
        return cells

    def half_of_energy(self, mode: int) -> float:
        """Share of the fine cells that hold half of a mode's strain energy."""
        held = np.cumsum(np.sort(self.cell_energy[:, mode])[::-1])
        return float((1 + np.searchsorted(held, 0.5 * held[-1])) / len(held))

    def worst_elements(self, mode: int) -> list[dict[str, Any]]:
        """The elements with the largest shares of a mode's errors, as plain values.

        They are `place` [m] of the middle of its cells, bit `pattern` of the filled ones and their
        number, `energy`, and `blame` and `share`: see `blamed` and `shares`.
        """
        blamed = self.blamed[:, mode]
        worst = np.argsort(-blamed, kind="stable")[:LISTED]
        return [self._element(index, mode) for index in worst if blamed[index] > 0.0]

    def _element(self, index: int, mode: int) -> dict[str, Any]:
        blocks = self._blocks
        cells = blocks.fine_of_block[index][blocks.mask[index]]
        middle = (blocks.fine.grid[cells] + 0.5).mean(axis=0)
        return {
            "place": (blocks.fine.origin + blocks.fine.edge * middle).tolist(),
            "pattern": int(blocks.pattern[index]),
            "cells": len(cells),
            "energy": float(self.energy[index, mode]),
            "blame": float(self.blamed[index, mode]),
            "share": float(self.shares[index, mode]),
        }
