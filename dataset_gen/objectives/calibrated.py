"""Objective `calibrated`: `factored`, corrected by what whole spectra ask for.

`E = c_p E_free(1_p) (O(e) / O(1_p))^(1-s) (G(e) / G(1_p))^s`, elementwise, with 1_p the block of
unit modulus and the same void pattern p, O the moduli of `oversampled`, G those of the Galerkin
projection, E_free(1_p) those of `inertial` (of `oversampled` where no cell is void). The factors
c_p, the exponent s and the share of lumped mass that goes with them are constants, chosen once so
that the spectra of many random solids come out right; see `python -m solver calibrate`.

The energies of a lone block cannot tell how its neighbours hold it, nor how much too stiff the
coarse mesh is between its nodes; a spectrum can. A product of powers with exponents that sum to one
stays homogeneous of degree one, and factors that are equal on octants which the pattern's
symmetries exchange keep it equivariant.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from dataset_gen.block import galerkin_moduli
from dataset_gen.element import Array
from dataset_gen.objectives import inertial, oversampled
from dataset_gen.objectives.calibration import ALL_FILLED, Calibration, default_calibration
from dataset_gen.objectives.quadratic import PatternFits


def contrast_logs(young: Array, held: Array, mask: int, poisson: float) -> tuple[Array, Array]:
    """`log O(e)/O(1_p)` and `log G(e)/G(1_p)` (n, 8) of blocks with the moduli `held` = O(e)."""
    unit = _unit_block(mask)
    return (
        np.log(held / _held_unit(mask, poisson)),
        np.log(galerkin_moduli(young) / galerkin_moduli(unit)),
    )


@cache
def unit_moduli(mask: int, poisson: float) -> Array:
    """E_free(1_p) (8,): coarse moduli of a block of one material before calibration."""
    if mask == ALL_FILLED:
        return _held_unit(mask, poisson)
    return np.asarray(inertial.fit_pattern(_unit_block(mask), mask, poisson).moduli[0])


@cache
def _held_unit(mask: int, poisson: float) -> Array:
    return np.asarray(oversampled.fit_pattern(_unit_block(mask), mask, poisson).moduli[0])


def _unit_block(mask: int) -> Array:
    return (mask >> np.arange(8) & 1).astype(float)[None]


def combine(
    calibration: Calibration, young: Array, held: Array, mask: int, poisson: float
) -> Array:
    """Moduli (n, 8) of blocks with the moduli `held` of `oversampled`."""
    filled = mask == ALL_FILLED
    share = calibration.galerkin_filled if filled else calibration.galerkin_void
    ours, projected = contrast_logs(young, held, mask, poisson)
    contrast = np.exp((1.0 - share) * ours + share * projected)
    return np.asarray(calibration.factors[mask] * unit_moduli(mask, poisson) * contrast)


def fit_pattern(young: Array, mask: int, poisson: float) -> PatternFits:
    """Fit blocks (n, 8) that share the void pattern `mask`, the least of its class.

    The residual is that of `oversampled`.
    """
    held = oversampled.fit_pattern(young, mask, poisson)
    return held._replace(moduli=combine(default_calibration(), young, held.moduli, mask, poisson))
