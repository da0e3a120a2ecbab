"""Whether a coarse model is worth solving or refining, or the fine solid is solved instead.

Unknowns, modes, moduli and estimated errors decide, so every machine decides the same.  Times of
block Lanczos iterations over 465 to 25,086 unknowns and 60 to 256 modes follow `analysis_work` to
about a third, and ratios of them better.  Its unit is none: only ratios are made use of.
"""

import numpy as np

from carillon.arrays import Array
from carillon.fem.block import ALL_FILLED
from carillon.fem.geometry import Blocks
from solver.analysis.options import SolverOptions
from solver.coarsening.model import block_moduli
from solver.refinement.errors import FINE_BLOCKS, WORST, ExpectedErrors, RefinementStep
from solver.refinement.estimate import ErrorEstimate, mean_shares
from solver.refinement.refined_model import RefinedModel

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


class Weighing:
    """Weighs the work of a coarse model against that of the fine solid, on rank 0."""

    def __init__(self, refined: RefinedModel, tolerance: float, options: SolverOptions) -> None:
        self._refined = refined
        self._tolerance = tolerance
        self._options = options
        self._fine_work = self._analysis_work(refined.fine.n_dofs)
        self._spent = 0.0
        self._excuse = ""

    def before(self) -> str | None:
        """Why the fine solid is to be solved at once."""
        refined = self._refined
        if refined.is_fine_given:
            return "the modes to start from are those of the fine solid"
        if refined.is_given:
            return None
        if not is_followed(refined.blocks, refined.young):
            ratio = variation(refined.blocks, refined.young)
            return (
                "the material varies from voxel to voxel, by a factor of "
                f"{ratio:,.0f} in a typical block, which coarse elements cannot follow"
            )
        unknowns, options = (refined.fine.n_dofs, refined.n_dofs), self._options
        if not is_clearly_less(*unknowns, options.modes, options.method):
            return (
                "the fine solid has so few unknowns that a coarse one and its check would save "
                "little"
            )
        return None

    def step(self, errors: ExpectedErrors) -> RefinementStep:
        """The model as it is now, and what is expected of it."""
        return RefinementStep(self._refined.n_dofs, FINE_BLOCKS, self._refined.fine_blocks, errors)

    def after(self, estimate: ErrorEstimate) -> tuple[bool, str | None]:
        """Whether the model is good enough, and if not, why it cannot be refined."""
        self._spent += self._coarse_work() + self._estimate_work()
        missed, errors = estimate.fine.missed, estimate.errors
        if errors.excess(self._tolerance) <= 1.0:
            lacks = "1 mode" if missed == 1 else f"{missed} modes"
            return (
                not missed,
                f"the coarse model lacks {lacks} of the fine solid" if missed else None,
            )
        self._excuse = (
            f"the coarse model's frequencies are expected to be {errors.rms:.1%} off "
            f"({100 * self._tolerance:g}% allowed), the worst {errors.worst:+.1%} "
            f"({100 * WORST * self._tolerance:g}% allowed, mode {errors.worst_mode}), and keeping "
            "blocks fine would save little"
        )
        return False, self.after_refining()

    def refine(self, estimate: ErrorEstimate, vectors: Array | None) -> None:
        """Keep fine the elements that are to blame, by modes (n_dofs, k) of the fine solid."""
        assert vectors is not None
        refined, values = self._refined, estimate.fine.values[: vectors.shape[1]]
        shares = mean_shares(refined.blocks, refined.model, refined.fine, values, vectors)
        refined.refine(shares, estimate.errors.excess(self._tolerance))

    def after_refining(self) -> str | None:
        """Why the model as it is now is not worth solving."""
        total = self._spent + self._coarse_work() + self._estimate_work()
        return self._excuse if total > REFINED * self._fine_work else None

    def _coarse_work(self) -> float:
        return self._analysis_work(self._refined.n_dofs)

    def _analysis_work(self, unknowns: int) -> float:
        return analysis_work(unknowns, self._options.modes, self._options.method)

    def _estimate_work(self) -> float:
        return estimate_work(self._refined.fine.n_dofs, again=self._spent > 0.0)


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

    Both are of so many unknowns.

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
