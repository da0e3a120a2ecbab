"""Coarse elements for blocks whose cells have any elasticity: isotropic, orthotropic, turned.

Block and element are those of `hybrid` or `calibrated`, but every cell has an elasticity matrix C_j
of its own, and the element of edge 2h is

    K_c = 2 h sum_q s_q B_q^T C_q B_q / 8

with the matrix C_q of the cell in the octant q. The fit finds the eight scales s_q.

`calibrated` has constants from spectra of isotropic solids. Its block of unit modulus is here the
one whose filled cells all have the mean of the matrices.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from carillon.arrays import Array, Flags
from carillon.errors import UserError
from carillon.fem.block import ALL_FILLED, galerkin_moduli, pattern_images, symmetries
from dataset_gen.objectives import require_objective
from dataset_gen.objectives.calibration import default_calibration
from dataset_gen.objectives.elasticity import filled_mean, stiffness_size, turned
from dataset_gen.objectives.general_cells import GeneralBlocks, fit_held, fit_hybrid
from dataset_gen.objectives.quadratic import PatternFits

GENERAL_OBJECTIVES = ("hybrid", "calibrated")
"""Objectives that general cells can be fitted by."""


class ScaleFits(NamedTuple):
    """Result of `fit_blocks`."""

    scales: Array
    """(n, 8) factors s on the octants' elasticity matrices, positive."""
    residual: Array
    """(n,) root of the objective relative to its value for s = 0."""
    converged: Flags
    """(n,) whether the minimiser settled."""


def _fit_calibrated(blocks: GeneralBlocks, mask: int) -> PatternFits:
    """Moduli by `calibrated`, see `dataset_gen.objectives.calibrated`.

    Blocks of one matrix have no contrast, and need one fit instead of three.
    """
    calibration = default_calibration()
    cells, basis = blocks
    filled = mask >> np.arange(8) & 1 > 0
    flags = np.broadcast_to(filled, cells.shape[:2])
    mean = filled_mean(cells, flags)
    alike = GeneralBlocks(np.where(filled[:, None, None], mean[:, None], 0.0), basis)
    first = cells[:, filled.argmax()]
    mixed = np.flatnonzero((cells[:, filled] != first[:, None]).any(axis=(1, 2, 3)))
    fits = fit_hybrid(alike, mask)
    moduli = calibration.factors[mask] * fits.moduli
    if len(mixed):
        some, level = blocks.take(mixed), alike.take(mixed)
        held = fit_held(some, mask)
        share = calibration.galerkin_filled if mask == ALL_FILLED else calibration.galerkin_void
        projected = galerkin_moduli(stiffness_size(some.cells)) / galerkin_moduli(
            stiffness_size(level.cells)
        )
        contrast = held.moduli / fit_held(level, mask).moduli
        moduli[mixed] *= contrast ** (1.0 - share) * projected**share
        fits.residual[mixed] = held.residual
        fits.converged[mixed] &= held.converged
    return PatternFits(moduli, fits.residual, fits.converged)


_FITS = {"hybrid": fit_hybrid, "calibrated": _fit_calibrated}


def _require_blocks(elasticity: Array, filled: Flags) -> None:
    if filled.ndim != 2 or filled.shape[1] != 8:
        raise UserError(f"filled cells have shape {filled.shape}, expected (n, 8)")
    if elasticity.shape != (*filled.shape, 6, 6):
        raise UserError(
            f"elasticity matrices have shape {elasticity.shape}, expected {(*filled.shape, 6, 6)}"
        )
    empty_blocks = np.flatnonzero(~filled.any(axis=1))
    if len(empty_blocks):
        raise UserError(f"block {empty_blocks[0]} is void in all eight cells: nothing to fit")
    if not np.isfinite(elasticity).all():
        raise UserError("elasticity matrices must be finite")


def _laws(elasticity: Array, filled: Flags) -> Array:
    """Matrices (n, 8, 6, 6); where a void octant has zeros, the mean of the filled cells."""
    nothing = ~filled & ~elasticity.any(axis=(2, 3))
    mean = filled_mean(elasticity, filled)[:, None]
    return np.where(nothing[..., None, None], mean, elasticity)


def fit_blocks(
    elasticity: ArrayLike, filled: ArrayLike, objective: str = "calibrated"
) -> ScaleFits:
    """Fit the coarse elements of many blocks.

    Raises UserError for an unknown objective, bad shapes, a block without filled cells, a matrix
    that is not positive definite.

    Parameters
    ----------
    elasticity : (n, 8, 6, 6)
        Elasticity matrix of each cell [Pa], symmetric. At a void octant it is the one that the
        coarse element has there; zeros stand for the mean of the filled cells.
    filled : (n, 8) bool
        Which cells are filled.
    objective
        One of `GENERAL_OBJECTIVES`.

    Notes
    -----
    The scales do not change when all matrices of a block are multiplied by a number. A row's result
    does not depend on the other rows, bit for bit. One core is used.

    Examples
    --------
    >>> from carillon.fem.element import elasticity_matrix
    >>> fits = fit_blocks(np.tile(elasticity_matrix(0.3), (1, 8, 1, 1)), np.ones((1, 8)))
    >>> bool(np.allclose(fits.scales, fits.scales[0, 0])), bool(0.8 < fits.scales[0, 0] < 1.0)
    (True, True)
    """
    require_objective(objective, GENERAL_OBJECTIVES)
    matrices, flags = np.asarray(elasticity, dtype=float), np.asarray(filled, dtype=bool)
    _require_blocks(matrices, flags)
    laws = _laws(matrices, flags)
    size = stiffness_size(laws)
    if not (size > 0.0).all():
        raise UserError("an elasticity matrix is not positive definite")
    unit = laws / size[..., None, None]
    largest = np.where(flags, size, 0.0).max(axis=1)
    masks = flags @ (1 << np.arange(8))
    images = pattern_images()
    symmetry = images.argmin(axis=1)[masks]
    least, turn = images.min(axis=1)[masks], symmetries()[symmetry]
    place = turn[..., None, None]
    basis, cells = np.empty_like(unit), np.empty_like(unit)
    unit_turned = turned(unit, symmetry)
    np.put_along_axis(basis, place, unit_turned, axis=1)
    scaled = np.where(flags, size / largest[:, None], 0.0)[..., None, None]
    np.put_along_axis(cells, place, scaled * unit_turned, axis=1)
    blocks = GeneralBlocks(cells, basis)
    moduli = np.empty_like(size)
    residual, converged = np.empty(len(size)), np.empty(len(size), dtype=bool)
    for mask in np.unique(least):
        rows = np.flatnonzero(least == mask)
        try:
            fits = _FITS[objective](blocks.take(rows), int(mask))
        except np.linalg.LinAlgError:
            raise UserError("an elasticity matrix is not positive definite") from None
        moduli[rows], residual[rows], converged[rows] = fits
    scales = np.take_along_axis(moduli, turn, axis=1) * (largest[:, None] / size)
    return ScaleFits(scales, residual, converged)
