"""Coarsening of solids whose cells have elasticity matrices of several laws."""

import numpy as np

from carillon.arrays import Array, Index
from dataset_gen.objectives import DEFAULT_OBJECTIVE, lumped_share
from dataset_gen.objectives.anisotropic import GENERAL_OBJECTIVES, fit_blocks

CHUNK = 4096
"""Blocks fitted at a time; each takes about 15 kB."""


def general_objective(objective: str) -> str:
    """Objective by which general cells are fitted where isotropic ones are by `objective`."""
    return objective if objective in GENERAL_OBJECTIVES else DEFAULT_OBJECTIVE


def octant_laws(young: Array, law: Index) -> Index:
    """Law (mc, 8) of every octant of the coarse elements.

    A void octant has the one that most of the block's filled cells have, of several the first: an
    element needs a law there, though its modulus is small. `young` (mc, 8) is 0 where a cell is
    void, where `law` (mc, 8) means nothing.
    """
    filled = young > 0.0
    # As many votes for a cell's law as filled cells have it; the lower number wins a tie.
    votes = ((law[:, :, None] == law[:, None, :]) & filled[:, None, :]).sum(axis=2)
    numbers = law.max(initial=0) + 1
    best = np.where(filled, votes * numbers - law, -numbers).argmax(axis=1)
    most = np.take_along_axis(law, best[:, None], axis=1)
    return np.where(filled, law, most)


class AnisotropicCoarsening:
    """Fits of blocks whose cells have laws: `dataset_gen.objectives.anisotropic` for whole solids.

    Blocks that are equal but for a factor on their moduli are fitted once.

    Attributes
    ----------
    name
        What it is called on a command line.
    lumped_fraction
        Fraction of lumped mass in elements without void octants, see `ElasticModel`.
    """

    def __init__(self, objective: str = DEFAULT_OBJECTIVE) -> None:
        self.name = "fit"
        self.objective = objective
        self.lumped_fraction = lumped_share(objective)

    def moduli(self, young: Array, law: Index, elasticity: Array) -> Array:
        """Moduli (mc, 8) of the elements' octants, whose laws are `octant_laws(young, law)`.

        Raises UserError for an elasticity matrix that is not positive definite.

        Parameters
        ----------
        young : (mc, 8)
            Moduli of the blocks' cells, 0 where a cell is void.
        law : (mc, 8)
            Law of each cell, a row of `elasticity`.
        elasticity : (laws, 6, 6)
            Elasticity matrices for a modulus of 1.

        Examples
        --------
        >>> from carillon.fem.element import elasticity_matrix
        >>> laws = np.stack([elasticity_matrix(0.3), elasticity_matrix(0.2)])
        >>> young, law = np.full((1, 8), 2e9), np.array([[0, 1, 0, 1, 0, 1, 0, 1]])
        >>> moduli = AnisotropicCoarsening().moduli(young, law, laws)
        >>> moduli.shape, bool((moduli > 1.5e9).all()), bool((moduli < 2.2e9).all())
        ((1, 8), True, True)
        """
        laws = octant_laws(young, law)
        largest = young.max(axis=1, keepdims=True)
        ratios = young / largest
        keys = np.concatenate([ratios.view(np.int64), laws.astype(np.int64)], axis=1)
        # One string of bytes a row: several times as fast as rows of numbers.
        rows = np.ascontiguousarray(keys).view(f"V{keys.shape[1] * keys.itemsize}").ravel()
        _, first, row = np.unique(rows, return_index=True, return_inverse=True)
        distinct = np.empty((len(first), 8))
        for start in range(0, len(first), CHUNK):
            chosen = first[start : start + CHUNK]
            distinct[start : start + CHUNK] = self._fit(ratios[chosen], laws[chosen], elasticity)
        return np.asarray(largest * distinct[row])

    def _fit(self, ratios: Array, laws: Index, elasticity: Array) -> Array:
        filled = ratios > 0.0
        mean = ratios.sum(axis=1, keepdims=True) / filled.sum(axis=1, keepdims=True)
        moduli = np.where(filled, ratios, mean)
        matrices = moduli[..., None, None] * elasticity[laws]
        return moduli * fit_blocks(matrices, filled, self.objective).scales

    def record(self) -> dict[str, str]:
        """The objective."""
        return {"objective": self.objective}
