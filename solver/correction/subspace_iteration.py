"""The subspace iteration of an error correction, step by step or by block Lanczos."""

from collections.abc import Callable

import numpy as np

from carillon.arrays import Array, Index
from carillon.errors import ConvergenceError
from solver.assembly.system import System
from solver.correction.criteria import IMPROVED_GUARDS, LOOSE, carried_count, default_guard
from solver.correction.enrichment import Ritz, Step, enrich, relax
from solver.correction.krylov import ZERO_FRACTION
from solver.correction.lanczos import is_too_high, lanczos, mixed
from solver.correction.random_start import LanczosStart
from solver.correction.result import Correction
from solver.distribution.collective import bcast_from_root
from solver.linear import Approximate, Inverse, Lasting, LinearSolver
from solver.subspace.rayleigh_ritz import rayleigh_ritz, safe_shift
from solver.subspace.weyl import WEYL_EXPONENT

TYPICAL = 0.1
"""Largest median of the errors, as a share of the tolerance."""
NEARLY_ACCURATE = 100.0
"""Error, as a multiple of the tolerance, below which `lanczos` leaves a start to `krylov`."""
FOLLOWED = 50.0
"""Factor of `NEARLY_ACCURATE` where there is an inverse for a similar material."""
WORTH_INEXACT = 50.0
"""Largest error, as a multiple of the tolerance, at which that inverse serves for a second step."""
INEXACT_STEPS = 4
"""Largest number of steps that it serves for: what then is not accurate is not going to be."""
SHIFT_FRACTION = 0.52
"""Shift of an indefinite factorisation, as a share of the last requested eigenvalue."""
TOP, TOP_FRACTION, HIGHEST_TOP_SHIFT = 0.8, 0.98, 1.1
"""Shares of the last requested eigenvalue: if all modes below the first are accurate, the shift is
the second, and too high above the third."""
LANCZOS_RUNS, OFF_RESONANCE = 3, 0.97
"""Largest number of Lanczos iterations, and the factor that moves the shift off an eigenvalue."""
STAGNATION, PROGRESS = 6, 0.8
"""Number of steps after which a correction gives up unless the error fell to this share of their
worst."""
ROUGH_MASS = 0.5
"""Ratio of the consistent mass of a rough residual to that by row sums."""


class SubspaceIteration:
    """State of the subspace iteration."""

    def __init__(
        self,
        system: System,
        linear: LinearSolver,
        ritz: Ritz,
        requested: int,
        acceleration: str,
        similar: Lasting | None,
    ) -> None:
        self.system = system
        self.linear = linear
        self.ritz = ritz
        self.requested = requested
        self.inside = acceleration != "relaxation" and linear.indefinite
        self.lanczos = acceleration == "lanczos" and linear.indefinite
        self.share = SHIFT_FRACTION
        self.similar = similar
        self.made: Inverse | None = None
        guard = default_guard(requested)
        self.width = requested + guard
        self.reach = self.improved = requested + int(IMPROVED_GUARDS * guard)
        self.step: Step = enrich
        if acceleration == "relaxation":
            self.width = self.improved = len(ritz.values)
            self.step = relax
        self.known_errors: Array | None = None
        self.steps = self.solves = self.blocks = 0
        self.history: list[float] = []

    def go_on_from(self, begun: LanczosStart) -> None:
        """Count what was done before, and take over what is known."""
        self.made, self.known_errors, self.steps = begun.inverse, begun.result.errors, 1
        self.solves, self.blocks = begun.result.solves, begun.result.blocks

    def run(
        self,
        tolerance: float,
        max_steps: int,
        rough: bool,
        report: Callable[[int, float], None] | None,
        observe: Callable[[int, Array], None] | None,
        keep: bool,
    ) -> Correction:
        """Correct until the tolerance, or the last step allowed, is reached.

        See `solver.correction.error_correction.correct`, also for what is raised.
        """
        step = self.steps
        if tolerance >= LOOSE:
            # One step then has to do, for the last modes too.
            self.improved = self.width if rough else self.requested
        lanczos_may_run = self.lanczos and tolerance > 0.0 and max_steps > 0
        if lanczos_may_run and rough:
            self._run_lanczos(tolerance, observe)
            step = 1
        while True:
            errors, residual, active = self._residuals(tolerance)
            worst = float(errors.max(initial=0.0))
            self.history.append(worst)
            if report is not None:
                report(step, worst)
            accurate = _are_accurate(errors, tolerance)
            if accurate or step >= max_steps:
                break
            if step == 0 and lanczos_may_run and worst > self._nearly_accurate() * tolerance:
                self._run_lanczos(tolerance, observe)
                step = 1
                continue
            if tolerance > 0.0 and self._stagnates():
                if keep:
                    break
                raise ConvergenceError(
                    f"error correction stagnates at an eigenvalue error of {min(self.history):.1e} "
                    f"after {step} steps, {tolerance:.1e} was asked for; use another linear solver "
                    "(--linear-solver), a looser tolerance or --method slepc"
                )
            inverse = self._inverse(step, tolerance)
            try:
                correction = inverse.solve(np.ascontiguousarray(residual))
            except ConvergenceError as error:
                if keep and error.collective:
                    break
                raise
            self.solves += correction.shape[1]
            self.blocks += 1
            self.step(self.ritz, correction, active, inverse, self.width)
            step += 1
            self._require_independent(step)
            if observe is not None:
                observe(step, np.sort(self.ritz.values)[: self.requested])
        if tolerance > 0.0 and not accurate and not keep:
            raise ConvergenceError(
                f"error correction reached an eigenvalue error of {worst:.1e} after {step} steps, "
                f"{tolerance:.1e} was asked for; allow more steps or keep more modes"
            )
        values, vectors, errors = self.ritz.lowest(len(self.ritz.values))
        return Correction(
            values[: self.requested],
            vectors[:, : self.requested],
            errors[: self.requested],
            np.ascontiguousarray(vectors[:, self.requested :]),
            step,
            self.solves,
            self.blocks,
            self.history,
        )

    def _run_lanczos(self, tolerance: float, observe: Callable[[int, Array], None] | None) -> None:
        width = carried_count(self.requested, tolerance)
        # Again where a poor start has put the shift too high, or chance on an eigenvalue; a start
        # that knows nothing of the spectrum needs one from below.
        for run in range(LANCZOS_RUNS):
            self.inside = run < LANCZOS_RUNS - 1
            inverse, ritz = self._exact_inverse(), self.ritz
            start, look = mixed(
                self.system, ritz.values, ritz.vectors, self.requested, inverse.shift, tolerance
            )
            result = lanczos(self.system, inverse, start, self.requested, width, tolerance, look)
            self.solves += result.solves
            self.blocks += result.blocks
            if result.resonant:
                self.destroy()
                self.share *= OFF_RESONANCE
                continue
            bounds = (1.0 + tolerance) * ritz.values[: self.requested]
            missed = (
                len(result.values) < self.requested
                or (result.values[: self.requested] > bounds).any()
            )
            self.ritz = Ritz(self.system, result.values, result.vectors)
            self._require_independent(1)
            if not (result.too_high or self._too_high(inverse)):
                if missed:
                    # No eigenvalue lies above the start's, so `krylov` has to go on from there.
                    self.ritz = ritz
                else:
                    self.known_errors = result.errors
                break
            self.destroy()
        self.inside = True
        if observe is not None:
            observe(1, self.ritz.values[: self.requested])

    def _require_independent(self, step: int) -> None:
        if len(self.ritz.values) < self.requested:
            raise ConvergenceError(
                f"the iterated vectors collapsed to {len(self.ritz.values)} independent ones "
                f"after {step} steps, {self.requested} modes are wanted; keep more"
            )

    def _nearly_accurate(self) -> float:
        return NEARLY_ACCURATE * (1.0 if self.similar is None else FOLLOWED)

    def _inverse(self, step: int, tolerance: float) -> Inverse:
        """Inverse for a step: the one for a similar material as long as that gets on."""
        similar = None if self.made is not None else self.similar
        near = step == 0 or self.history[-1] <= WORTH_INEXACT * tolerance
        near &= step < INEXACT_STEPS
        if similar is not None and near and not self._too_high(similar):
            ritz = self.ritz
            return Approximate(similar, self.system, ritz.vectors, ritz.mass_vectors)
        return self._exact_inverse()

    def _exact_inverse(self) -> Inverse:
        """Inverse for this material, made anew if a start far off has put the shift too high."""
        if self.made is not None and self.inside and self._too_high(self.made):
            self.destroy()
        if self.made is None:
            self.made = self.linear.inverse(self.system, self._shift())
        return self.made

    def _too_high(self, inverse: Inverse) -> bool:
        if self._only_top_is_left():
            return inverse.shift > HIGHEST_TOP_SHIFT * self._last()
        return is_too_high(self.system, inverse, self.requested, self._last())

    def lasting(self, tolerance: float) -> Lasting | None:
        """The inverse to keep for a similar material, which only a loose tolerance makes use of."""
        kept = self.similar if self.made is None else self.made
        return kept if isinstance(kept, Lasting) and tolerance >= LOOSE else None

    def destroy(self) -> None:
        """Free what the inverse made here holds; of one that lasts, nothing has to be."""
        if self.made is not None:
            self.made.destroy()
            self.made = None

    def _last(self) -> float:
        return float(np.sort(self.ritz.values)[self.requested - 1])

    def _shift(self) -> float:
        if not self.inside:
            return -safe_shift(self.system)
        return self._last() * (TOP_FRACTION if self._only_top_is_left() else self.share)

    def _only_top_is_left(self) -> bool:
        lowest = float(self.ritz.values[self.ritz.active].min(initial=np.inf))
        return self.ritz.locked > 0 and lowest > TOP * self._last()

    def _residuals(self, tolerance: float) -> tuple[Array, Array, Index]:
        """Errors of the wanted modes, and residuals of those to improve with their numbers.

        Wanted modes that have become accurate are locked.  A block Lanczos iteration has told
        errors of its own, far closer than those from residuals.
        """
        ritz = self.ritz
        known, self.known_errors = self.known_errors, None
        if known is not None and len(known):
            if _are_accurate(known, tolerance):
                ritz.errors[: self.requested] = known
                return known, ritz.vectors[:, :0], ritz.active[:0]
            # Far below the shift rounding mixes modes.
            ritz = self.ritz = Ritz(self.system, *rayleigh_ritz(self.system, ritz.vectors))
        # A vector may have been locked before others were found below it.
        order = np.argsort(ritz.values, kind="stable")
        ritz.unlock(order[self.requested :])
        candidates = ritz.active[np.isin(ritz.active, order[: self.improved])]
        residual = ritz.residual(candidates)
        estimate = self._estimate(candidates, residual)
        ritz.errors[candidates] = bcast_from_root(self.system.comm, lambda: estimate)
        lowest = np.argsort(ritz.values, kind="stable")[: self.requested]
        errors = np.nan_to_num(ritz.errors[lowest], nan=np.inf)
        limit = tolerance if _typical(errors) <= TYPICAL * tolerance else TYPICAL * tolerance
        inside = candidates[np.isin(candidates, lowest)]
        accurate = inside[ritz.errors[inside] <= limit]
        chosen = ~np.isin(candidates, accurate)
        ritz.lock(accurate)
        return errors, residual[:, chosen], candidates[chosen]

    def _estimate(self, candidates: Index, residual: Array) -> Array:
        values = self.ritz.values[candidates]
        last = self._first_beyond()
        rows = self.system.rows
        mass = rows.lumped_mass
        if not rows.has_diagonal_mass:
            # Row sums of cells that a surface cuts may be small or negative.
            diagonal = rows.mass_diagonal
            mass = np.where(mass >= diagonal, ROUGH_MASS * mass, diagonal)
        weighted = residual / np.repeat(mass, 3)[:, None]
        square = self.system.column_products(residual, weighted)
        distance = np.maximum(last - values, np.finfo(float).eps * last)
        size = np.maximum(values, ZERO_FRACTION * last)
        return np.maximum(square / (size * distance), np.finfo(float).eps)

    def _first_beyond(self) -> float:
        """Value up to which the subspace holds all that is there.

        Those of the guard vectors of another material are far too high: until they are improved
        they count for no more than Weyl's law says.
        """
        values = np.sort(self.ritz.values)
        if self.step is relax:
            return float(values[(3 * self.requested + len(values)) // 4])
        number = min(self.reach, len(values))
        value = float(values[number - 1])
        if self.blocks == 0 and self.similar is not None:
            grown = (number / self.requested) ** WEYL_EXPONENT
            return min(value, grown * float(values[self.requested - 1]))
        return value

    def _stagnates(self) -> bool:
        recent = self.history[-STAGNATION - 1 :]
        return len(recent) > STAGNATION and recent[-1] > PROGRESS * max(recent[:-1])


def _are_accurate(errors: Array, tolerance: float) -> bool:
    worst = float(errors.max(initial=0.0))
    return worst <= tolerance and _typical(errors) <= TYPICAL * tolerance


def _typical(errors: Array) -> float:
    return float(np.median(errors)) if len(errors) else 0.0
