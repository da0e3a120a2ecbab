"""Space mapping: a search on a coarse solid for a design that is right on the fine solid.

The errors of the coarse solid are nearly the same for similar materials.  So the errors that a
check finds at one material correct the targets of the next coarse search: with fine frequencies f
and coarse ones c of the material, the target F of each mode becomes F c / f, and balances of
amplitudes are shifted by their difference [BCD+04].  The coarse search is then exact at the
material that was checked.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from carillon.arrays import Array
from carillon.errors import ConvergenceError
from solver.files.modes_file import frequencies
from sound.design.assignment import placed
from sound.design.fine_check import FineModes
from sound.design.objective import Objective
from sound.design.optimisers import descend_finely
from sound.design.pitch import rms_cents, rms_off_partials
from sound.design.search import MET, BudgetSpentError, CheckEntry, Search, require_modes
from sound.design.simulation import Evaluation
from sound.design.tasks import SearchStep, Trial

FIRST_SHARE, LARGEST_SHARE = 0.2, 0.35
"""Share of the remaining budget of the first leg on the coarse solid, and the greatest share of
any."""
LONGER = 1.5
"""Ratio of the shares of successive legs."""
WORTHWHILE = 0.5
"""Greatest ratio of the fine costs after and before a coarse leg, for the next leg to be coarse,
too; otherwise it is on the fine solid."""
MET_CENTS = 5.0
"""Root mean square distance of fine frequencies from their targets that is hardly audible
[cents]."""
GAIN, FRUITLESS = 0.01, 2
"""Least relative decrease of the cost by a fruitful leg, and number of successive fruitless legs,
one on each solid, that end a search whose frequencies are met."""

Optimiser = Callable[..., None]


@dataclass(frozen=True)
class Checked:
    """A material with its modes on the coarse and on the fine solid."""

    evaluation: Evaluation
    fine: FineModes

    @property
    def total(self) -> float:
        """Cost of the fine solid, Eq. (4)."""
        return self.fine.cost.total


def aimed(objective: Objective, fine: FineModes) -> Objective:
    """Objective of the coarse solid, corrected so that the fine solid meets its targets.

    The clips' residuals are left out, as a search does not use them.
    """
    targets = objective.targets
    hertz, silent = targets.frequencies, targets.silent
    if silent is not None:
        # Otherwise they would be put in another order than they are in.
        hertz = placed(fine.frequencies, hertz, silent)
    shifted = hertz * fine.ratios
    order = np.argsort(shifted, kind="stable")
    aims = replace(
        targets,
        frequencies=shifted[order],
        dampings=targets.dampings[order],
        amplitudes=targets.amplitudes[:, order],
        residuals=(),
        silent=None if silent is None else silent[order],
    )
    shift = fine.excess[:, order]
    return Objective(aims, objective.weights, shift, objective.absolute, objective.heard)


class SpaceMapping:
    """Legs of a coarse search, with a check on the fine solid after each.

    The objective is that of the fine solid, and `check` analyses a trial's material on both solids.
    `best` is the best material by its cost on the fine one.
    """

    def __init__(self, objective: Objective, check: Callable[[Trial], Checked]) -> None:
        self._objective = objective
        self._check = check
        self.best: Checked | None = None

    def run(self, search: Search, optimiser: Optimiser, seed: int, population: int | None) -> None:
        """Run legs from the first material of a search until its budget is spent.

        Every leg begins at the best material so far, with targets corrected there.  After a leg
        that gains little, the next one descends on the fine solid.  A search with a budget also
        ends when its frequencies are met and `FRUITLESS` legs gained little.
        """
        share, finely, fruitless = FIRST_SHARE, False, 0
        reserve = self._checked(search, require_modes(search))
        while not search.spent and (fruitless < FRUITLESS or search.endless or not self._met):
            assert self.best is not None
            best, z = self.best, self.best.evaluation.z
            try:
                if finely:
                    search.begin_leg(None, 1.0, reserve)
                    descend_finely(search, z)
                else:
                    search.begin_leg(aimed(self._objective, best.fine), share, reserve)
                    optimiser(search, z, seed, population)
            except BudgetSpentError:
                pass
            if search.best is None:
                continue
            # Rows of modes to start from belong to one of the two solids.
            reserve = self._checked(search, replace(search.best, start=None))
            finely = not finely and self.best.total > WORTHWHILE * best.total
            fruitless = fruitless + 1 if self.best.total > (1.0 - GAIN) * best.total else 0
            share = min(LONGER * share, LARGEST_SHARE)
            seed += 1
        if not search.spent:
            search.ending = MET

    def foretold(self, step: SearchStep) -> Array:
        """Expected frequencies (N,) [Hz] of the fine solid, in the order of the coarse modes."""
        hertz = frequencies(step.eigenvalues)
        if self.best is None:
            return hertz
        ratios = self.best.fine.ratios
        order = np.argsort(self._objective.targets.frequencies * ratios, kind="stable")
        return np.asarray(hertz[order] if step.fine else hertz / ratios[order])

    @property
    def _met(self) -> bool:
        assert self.best is not None
        off = rms_off_partials(self.best.fine.frequencies, self._objective.targets)
        return off <= MET_CENTS

    def _checked(self, search: Search, trial: Trial) -> float:
        """Check a material, and keep it if it is the best one; its processor time [s]."""
        begin = search.own_seconds
        try:
            checked = self._check(trial)
        except ConvergenceError:  # it has modes on the coarse solid only
            if self.best is None:
                raise
            return search.own_seconds - begin
        search.checks.append(self._entry(search, checked))
        if self.best is None or checked.total < self.best.total:
            self.best, search.best_checked = checked, trial
        return search.own_seconds - begin

    def _entry(self, search: Search, checked: Checked) -> CheckEntry:
        fine, targets = checked.fine, self._objective.targets
        ratios = fine.ratios if self.best is None else self.best.fine.ratios
        return CheckEntry(
            search.own_seconds,
            search.own_evaluations,
            rms_off_partials(np.sort(fine.coarse), targets),
            rms_off_partials(fine.frequencies, targets),
            rms_cents(fine.coarse / ratios, fine.frequencies),
            checked.total,
        )
