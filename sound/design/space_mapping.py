"""Search on a coarse solid for what shall sound right on the fine one: space mapping.

The coarse model's errors change little from one material to a similar one.  So what a check finds
of them at one material is taken off what the coarse search aims at next: with fine frequencies f
and coarse ones c of a material, the target F of each mode becomes F c / f; balances of amplitudes
are shifted by their difference [BCD+04].  The search then foretells what is right on the fine
solid where the check was made.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from carillon.errors import ConvergenceError
from solver.files.modes_file import frequencies
from sound.design.cents import rms_cents
from sound.design.fine_check import FineModes
from sound.design.objective import Objective
from sound.design.optimisers import descend_finely
from sound.design.search import BudgetSpentError, CheckEntry, Search, require_modes
from sound.design.simulation import Evaluation
from sound.design.tasks import SearchStep, Trial

Array = NDArray[np.float64]

FIRST_SHARE, LARGEST_SHARE = 0.2, 0.35
"""Of what is left of the budget: of the first leg on the coarse solid, and of any."""
LONGER = 1.5
"""Factor of a leg's share to the next one's."""

WORTHWHILE = 0.5
"""Share of the cost on the fine solid that a leg on the coarse one has to come down to, or the next
leg is on the fine solid."""

MET_CENTS = 5.0
"""Distance of fine frequencies from their targets (rms) that hardly anybody hears."""
GAIN, FRUITLESS = 0.01, 2
"""Share by which the cost has to fall for a leg not to be fruitless, and how many fruitless ones in
a row, one on each solid, end a search whose frequencies are met."""

Optimiser = Callable[..., None]


@dataclass(frozen=True)
class Checked:
    """A material, its modes on the coarse solid, and those on the fine one."""

    evaluation: Evaluation
    fine: FineModes

    @property
    def total(self) -> float:
        """Eq. (4) of the fine solid."""
        return self.fine.cost.total


def aimed(objective: Objective, fine: FineModes) -> Objective:
    """What a coarse solid has to sound like for the fine one to sound like the targets.

    The clips' residuals are left out, which no search looks at.
    """
    targets = objective.targets
    shifted = targets.frequencies * fine.ratios
    order = np.argsort(shifted, kind="stable")
    aims = replace(
        targets,
        frequencies=shifted[order],
        dampings=targets.dampings[order],
        amplitudes=targets.amplitudes[:, order],
        residuals=(),
    )
    return Objective(aims, objective.weights, fine.excess[:, order])


class SpaceMapping:
    """Legs of a coarse search, with a check on the fine solid after each.

    Parameters
    ----------
    objective
        What the fine solid shall sound like.
    check
        Modes of a trial's material on both solids.

    Attributes
    ----------
    best
        The best material by its cost on the fine solid.
    """

    def __init__(self, objective: Objective, check: Callable[[Trial], Checked]) -> None:
        self._objective = objective
        self._check = check
        self.best: Checked | None = None

    def run(self, search: Search, optimiser: Optimiser, seed: int, population: int | None) -> None:
        """Search from the first material of a search until its budget is spent.

        Every leg begins at the best material so far, and aims at the targets less the errors of the
        coarse solid there.  Where these gain little, one descends on the fine solid itself.  A
        search with a budget also ends where frequencies are met and legs have been fruitless.
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
            # Modes to start from are rows of one of the two solids.
            reserve = self._checked(search, replace(search.best, start=None))
            finely = not finely and self.best.total > WORTHWHILE * best.total
            fruitless = fruitless + 1 if self.best.total > (1.0 - GAIN) * best.total else 0
            share = min(LONGER * share, LARGEST_SHARE)
            seed += 1

    def foretold(self, step: SearchStep) -> Array:
        """What the fine solid is likely to sound at (N,) [Hz], in the order of the coarse modes."""
        hertz = frequencies(step.eigenvalues)
        if self.best is None:
            return hertz
        ratios = self.best.fine.ratios
        order = np.argsort(self._objective.targets.frequencies * ratios, kind="stable")
        return np.asarray(hertz[order] if step.fine else hertz / ratios[order])

    @property
    def _met(self) -> bool:
        """Whether the best material's frequencies are near enough to their targets."""
        assert self.best is not None
        off = rms_cents(self.best.fine.frequencies, self._objective.targets.frequencies)
        return off <= MET_CENTS

    def _checked(self, search: Search, trial: Trial) -> float:
        """Check a material, and remember it if it is the best one; how long that took [s]."""
        begin = time.monotonic()
        try:
            checked = self._check(trial)
        except ConvergenceError:  # modes to be had coarsely alone
            if self.best is None:
                raise
            return time.monotonic() - begin
        search.checks.append(self._entry(search, checked))
        if self.best is None or checked.total < self.best.total:
            self.best = checked
        return time.monotonic() - begin

    def _entry(self, search: Search, checked: Checked) -> CheckEntry:
        fine, wanted = checked.fine, self._objective.targets.frequencies
        ratios = fine.ratios if self.best is None else self.best.fine.ratios
        return CheckEntry(
            search.own_seconds,
            search.own_evaluations,
            rms_cents(np.sort(fine.coarse), wanted),
            rms_cents(fine.frequencies, wanted),
            rms_cents(fine.coarse / ratios, fine.frequencies),
            checked.total,
        )
