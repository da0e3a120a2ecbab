"""Whether a coarse model is worth solving or refining, or the fine solid is solved instead.

Unknowns, modes, moduli and estimated errors decide, so every machine decides the same.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.analysis.options import SolverOptions
from solver.refinement import work
from solver.refinement.errors import WORST, ExpectedErrors
from solver.refinement.estimate import ErrorEstimate, mean_shares
from solver.refinement.refine import FINE_BLOCKS, RefinementStep
from solver.refinement.refined_model import RefinedModel

Array = NDArray[np.float64]


class Weighing:
    """Weighs the work of a coarse model against that of the fine solid, on rank 0.

    Parameters
    ----------
    refined
        The coarse model.
    tolerance
        Expected error that is allowed.
    options
        What is computed and how.
    """

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
        if not work.is_followed(refined.blocks, refined.young):
            ratio = work.variation(refined.blocks, refined.young)
            return (
                "the material varies from voxel to voxel, by a factor of "
                f"{ratio:,.0f} in a typical block, which coarse elements cannot follow"
            )
        unknowns, options = (refined.fine.n_dofs, refined.n_dofs), self._options
        if not work.is_clearly_less(*unknowns, options.modes, options.method):
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
        return self._excuse if total > work.REFINED * self._fine_work else None

    def _coarse_work(self) -> float:
        return self._analysis_work(self._refined.n_dofs)

    def _analysis_work(self, unknowns: int) -> float:
        return work.analysis_work(unknowns, self._options.modes, self._options.method)

    def _estimate_work(self) -> float:
        return work.estimate_work(self._refined.fine.n_dofs, again=self._spent > 0.0)
