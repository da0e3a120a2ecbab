"""Objective `calibrated`: `factored`, corrected by what whole spectra ask for.

`E = c_p E_free(1_p) (O(e) / O(1_p))^(1-s) (G(e) / G(1_p))^s`, elementwise, with 1_p the block of
unit modulus and the same void pattern p, O the moduli of `oversampled`, G those of the Galerkin
projection, E_free(1_p) those of `inertial` (of `oversampled` where no cell is void). The factors
c_p, the exponent s and the share of lumped mass that goes with them are constants, chosen once so
that the spectra of many random solids come out right.

The energies of a lone block cannot tell how its neighbours hold it, nor how much too stiff the
coarse mesh is between its nodes; a spectrum can. A product of powers with exponents that sum to one
stays homogeneous of degree one, and factors that are equal on octants which the pattern's
symmetries exchange keep it equivariant.

Blocks are fitted at one Poisson's ratio, that of the calibration, and the moduli serve solids of
all ratios: the element's own matrices K_q follow the ratio. A fit at a higher one lowers a modulus
as far as bending, which locks more in the coarse element than in the block, asks for, and with it
the answer to stretching and shear, which was right.
"""

import numpy as np

from carillon.arrays import Array
from carillon.fem.block import ALL_FILLED, galerkin_moduli
from dataset_gen.objectives import oversampled
from dataset_gen.objectives.calibration import Calibration, default_calibration
from dataset_gen.objectives.factored import held_unit_moduli, unit_block, unit_moduli
from dataset_gen.objectives.quadratic import PatternFits


def contrast_logs(young: Array, held: Array, unit: Array, held_unit: Array) -> tuple[Array, Array]:
    """`log O(e)/O(1_p)` and `log G(e)/G(1_p)` (n, 8) of blocks e = `young` (n, 8).

    `unit` are the blocks 1_p, (n, 8) or one for all; `held` and `held_unit` the moduli O of both.
    """
    return (np.log(held / held_unit), np.log(galerkin_moduli(young) / galerkin_moduli(unit)))


def combine(calibration: Calibration, young: Array, held: Array, mask: int) -> Array:
    """Moduli (n, 8) of blocks with the moduli `held` of `oversampled`."""
    filled, poisson = mask == ALL_FILLED, calibration.poisson
    share = calibration.galerkin_filled if filled else calibration.galerkin_void
    ours, projected = contrast_logs(young, held, unit_block(mask), held_unit_moduli(mask, poisson))
    contrast = np.exp((1.0 - share) * ours + share * projected)
    return np.asarray(calibration.factors[mask] * unit_moduli(mask, poisson) * contrast)


def fit_pattern(young: Array, mask: int, poisson: float) -> PatternFits:
    """Fit blocks (n, 8) that share the void pattern `mask`, the least of its class.

    Moduli do not depend on `poisson`. The residual is that of `oversampled`.
    """
    calibration = default_calibration()
    held = oversampled.fit_pattern(young, mask, calibration.poisson)
    return held._replace(moduli=combine(calibration, young, held.moduli, mask))
