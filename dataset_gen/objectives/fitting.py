"""Coarse moduli of many blocks by any objective."""

from functools import cache
from importlib import import_module
from types import ModuleType
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from carillon.arrays import Array, Flags, Index
from carillon.errors import UserError
from carillon.fem.block import pattern_images, symmetries, void_patterns
from carillon.fem.element import DEFAULT_POISSON
from dataset_gen.objectives import SAMPLED, require_objective, require_poisson, sampled_energy


def module_of(objective: str) -> ModuleType:
    """Module of an objective, whose `fit_pattern` fits blocks (n, 8) of one void pattern."""
    return import_module(f"dataset_gen.objectives.{objective}")


class Fits(NamedTuple):
    """Result of `fit`."""

    moduli: Array
    """(n, 8) coarse moduli E, in the unit of the fine ones, positive."""
    residual: Array
    """(n,) root of the objective relative to its value for E = 0."""
    converged: Flags
    """(n,) whether the minimiser settled."""


def _require_blocks(young: Array) -> None:
    if young.ndim != 2 or young.shape[1] != 8:
        raise UserError(f"fine moduli have shape {young.shape}, expected (n, 8)")
    if not np.isfinite(young).all() or (young < 0.0).any():
        raise UserError("fine moduli must be finite and not negative")
    empty = np.flatnonzero(~(young > 0.0).any(axis=1))
    if len(empty):
        raise UserError(f"block {empty[0]} is void in all eight cells: there is nothing to fit")


@cache
def orientations() -> tuple[Index, Index]:
    """Least image (256,) of each void pattern under the symmetries, and the one used (256, 8).

    Cell j of the pattern is cell [mask, j] of its image.
    """
    images = pattern_images()
    return images.min(axis=1), symmetries()[images.argmin(axis=1)]


def fit(objective: str, e: ArrayLike, poisson: float = DEFAULT_POISSON) -> Fits:
    """Fit the coarse moduli of many blocks.

    Raises UserError for an unknown objective, a bad shape, a negative or non-finite modulus, an
    all-void block.

    Parameters
    ----------
    objective
        Name in `dataset_gen.objectives.OBJECTIVES`.
    e : (n, 8)
        Fine moduli in bit order, any unit, 0 where a cell is void.
    poisson
        Poisson's ratio of the solid, whose moduli by `calibrated` are the same for any.

    Notes
    -----
    Blocks are turned so that 21 void patterns stand for all 255, and those of one pattern are
    fitted together. A row's result does not depend on the other rows, bit for bit. One core is
    used: share many rows among processes.

    Examples
    --------
    >>> moduli = fit("oversampled", [[1, 1, 1, 1, 1, 1, 1, 1], [2, 2, 2, 2, 2, 2, 2, 2]]).moduli
    >>> bool(np.allclose(moduli[1], 2.0 * moduli[0])), moduli.shape
    (True, (2, 8))
    """
    require_objective(objective)
    require_poisson(objective, poisson)
    young = np.ascontiguousarray(e, dtype=float)
    _require_blocks(young)
    images, turns = orientations()
    masks = void_patterns(young)
    turn, image = turns[masks], images[masks]
    turned = np.empty_like(young)
    np.put_along_axis(turned, turn, young, axis=1)
    moduli = np.empty_like(young)
    residual = np.empty(len(young))
    converged = np.empty(len(young), dtype=bool)
    for mask in np.unique(image):
        rows = np.flatnonzero(image == mask)
        fits = module_of(objective).fit_pattern(turned[rows], int(mask), float(poisson))
        moduli[rows], residual[rows], converged[rows] = fits
    return Fits(np.take_along_axis(moduli, turn, axis=1), residual, converged)


def fit_samples(objective: str, e: Array, seed: int, first: int, poisson: float) -> Fits:
    """Fit the samples `first`, `first` + 1, ... of a dataset, see `fit`.

    What is drawn for a fit depends on the dataset's `seed` and on the sample's number alone.
    """
    if objective != SAMPLED:
        return fit(objective, e, poisson)
    fits = [
        sampled_energy.fit_sample(young, seed, first + row, poisson) for row, young in enumerate(e)
    ]
    return Fits(*(np.concatenate(column) for column in zip(*fits)))
