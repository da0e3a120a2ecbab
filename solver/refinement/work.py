"""How much work analyses take, from counts alone: the same on every machine and number of ranks.

Times of block Lanczos iterations over 465 to 25,086 unknowns and 60 to 256 modes follow this law to
about a third, and ratios of them better. Its unit is none: only ratios are made use of.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carillon.fem.block import ALL_FILLED
from carillon.fem.geometry import Blocks
from solver.coarsening.model import block_moduli

Array = NDArray[np.float64]

MODES_OF_FACTOR = 50
"""Number of modes that take as long as the factorisation and all else that does not depend on
them."""
GROWTH, TYPICAL = 0.2, 8000
"""Exponent by which the work for an unknown grows, and the number of unknowns at which it is 1."""
OVERHEAD = 40_000
"""Work of any analysis, however small."""
ESTIMATE_MODES = 60
ESTIMATE, ESTIMATE_AGAIN = 0.5, 0.25
"""Work of the first estimate and of each further one, as shares of finding the modes that are
rated on the fine mesh."""
SLOWNESS = {"hcms": (2.0, 0.0), "slepc": (3.5, 0.35), "arpack": (4.0, 0.35)}
"""Work of an analysis by slower methods than the fastest: as a multiple of that at `TYPICAL`
unknowns, and the exponent by which it grows."""
CLEARLY, REFINED = 0.6, 0.8
"""Shares of the fine analysis's work below which a coarse model and its estimate are clearly less,
and a refined one with all that went before."""
FOLLOWED, WHOLE = 30.0, 0.9
"""Ratio of the moduli in a block above which no coarse element follows them, unless so large a
share of the elements is of whole blocks, whose surroundings even it out."""


def analysis_work(unknowns: int, modes: int, method: str = "auto") -> float:
    """Work of finding modes by a method of `SolverOptions`.

    Examples
    --------
    >>> 2.0 < analysis_work(8412, 60) / analysis_work(4000, 60) < 2.5
    True
    """
    growth = (unknowns / TYPICAL) ** GROWTH
    alone = unknowns * (min(modes, unknowns) + MODES_OF_FACTOR) * growth + OVERHEAD
    slowness, exponent = SLOWNESS.get(method, (1.0, 0.0))
    return slowness * (unknowns / TYPICAL) ** exponent * alone


def estimate_work(unknowns: int, again: bool = False) -> float:
    """Work of an estimate of a coarse model's errors on a fine mesh of so many unknowns."""
    share = ESTIMATE_AGAIN if again else ESTIMATE
    return share * analysis_work(unknowns, ESTIMATE_MODES)


def is_clearly_less(fine: int, coarse: int, modes: int, method: str = "auto") -> bool:
    """Whether a coarse model and the estimate of its errors are clearly less work than the fine.

    Parameters
    ----------
    fine, coarse
        Unknowns of both.
    modes, method
        That are asked for.

    Examples
    --------
    >>> is_clearly_less(18_000, 4_500, 256), is_clearly_less(3_000, 800, 60)
    (True, False)
    """
    spent = analysis_work(coarse, modes, method) + estimate_work(fine)
    return spent <= CLEARLY * analysis_work(fine, modes, method)


def variation(blocks: Blocks, young: Array) -> float:
    """Median over all elements of the ratio of the largest to the smallest modulus in them."""
    moduli = block_moduli(blocks, young)
    least = np.where(blocks.mask, moduli, np.inf).min(axis=1)
    return float(np.median(moduli.max(axis=1) / least))


def is_followed(blocks: Blocks, young: Array) -> bool:
    """Whether coarse elements are likely to follow a material (m,) [Pa] from voxel to voxel."""
    whole = float(np.mean(blocks.pattern == ALL_FILLED))
    return variation(blocks, young) <= FOLLOWED or whole >= WHOLE
