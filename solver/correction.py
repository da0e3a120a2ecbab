"""Error correction by accelerated subspace iteration (section 7.2.1, Eq. 16-21)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from carillon.errors import ConvergenceError
from solver.decomposition import on_root
from solver.enrichment import Ritz, Step, enrich, relax
from solver.inner import InnerSolver, Inverse
from solver.rayleigh_ritz import rayleigh_ritz, safe_shift
from solver.system import System

Array = NDArray[np.float64]

EIGENVALUE_TOLERANCE = 1e-7
"""Relative eigenvalue error that a correction stops at unless told otherwise."""
INTERACTIVE_TOLERANCE = 1e-2
"""Relative eigenvalue error of the worst mode that is good enough while a material is designed."""
ACCELERATIONS = ("krylov", "relaxation")
SHIFT_SHARE = 0.55
"""Shift of an indefinite factorisation, as a share of the last wanted eigenvalue."""
HIGHEST_SHIFT = 0.8
"""Share at which the shift is moved, when better Ritz values have left it too high."""
GUARD_SHARE, FEWEST_GUARDS = 0.22, 20
"""Vectors carried beyond the wanted ones, as a share of these, and the fewest of them."""
IMPROVED_GUARDS = 0.4
"""Share of the guard vectors that are improved too, for the sake of the last wanted modes."""
STAGNATION, PROGRESS = 6, 0.8
"""Steps after which a correction gives up, if the error is not below this share of their worst."""
ROUGH_MASS = 0.5
"""Consistent mass of a rough residual, as a share of what the row sums make of it."""


@dataclass
class Correction:
    """Corrected eigenpairs of the elastic modes.

    Attributes
    ----------
    values
        (k,) Ritz values [rad^2/s^2], ascending.
    vectors
        (local, k) mass-orthonormal, orthogonal to the rigid motions, row-major.
    errors
        (k,) estimated relative error of each value, from its residual.
    guard
        (local, g) what the iteration carried beyond; useful to start again from.
    steps
        Number of corrections made.
    solves
        Number of right-hand sides solved.
    history
        Largest estimated error before each step, and at the end.
    """

    values: Array
    vectors: Array
    errors: Array
    guard: Array
    steps: int = 0
    solves: int = 0
    history: list[float] = field(default_factory=list)


def correct(
    system: System,
    start: Array,
    wanted: int,
    inner: InnerSolver,
    values: Array | None = None,
    tolerance: float = EIGENVALUE_TOLERANCE,
    max_steps: int = 30,
    acceleration: str = "krylov",
    report: Callable[[int, float], None] | None = None,
    observe: Callable[[int, Array], None] | None = None,
) -> Correction:
    """Improve the `wanted` lowest elastic modes from the block `start` until they are accurate.

    A step solves (K - mu M) Z = K X - X Theta M for every mode that is not yet accurate.  With
    `krylov` the Rayleigh-Ritz method then runs in the span of X and Z together, which holds what
    the subspace iteration of Eq. (16)-(21) would reach with the best weights; with `relaxation` in
    the span of X - w Z with the over-relaxation w of Bathe & Ramaswamy (1980), as in the paper.
    Accurate modes are locked.

    Parameters
    ----------
    start
        (local, q) approximate modes, q > wanted for a margin.
    wanted
        Number of elastic modes to correct.
    inner
        Solver of the linear systems.
    values
        (q,) Ritz values of `start`, if its columns are mass-orthonormal Ritz vectors orthogonal to
        the rigid motions; otherwise a Rayleigh-Ritz step makes such of them first.
    tolerance
        Largest accepted relative eigenvalue error, as estimated from the residual.
    max_steps
        Steps allowed; reaching `tolerance` within them is not required when `tolerance` is zero.
    report
        Called with the step and the largest estimated error of the wanted modes.
    observe
        Called with the step and the Ritz values of the wanted modes.

    Raises
    ------
    ConvergenceError
        If `tolerance` is positive and not reached.

    Notes
    -----
    The residual r = K x - theta M x of a Ritz pair bounds the relative error of theta, to second
    order, by r^T M^-1 r / (theta (theta_p - theta)), where theta_p is the last value that is
    improved.  M is replaced by its row sums, of a consistent mass by half of them.

    With `krylov` and a direct solver the shift mu lies in the middle of the wanted spectrum: the
    last modes converge like (theta - mu) / (theta_p - mu), and the first are accurate early.
    Otherwise it lies below the spectrum.
    """
    if values is None:
        values, start = rayleigh_ritz(system, start)
    if len(values) < wanted:
        raise ConvergenceError(
            f"the start block spans {len(values)} elastic modes, {wanted} are wanted; keep more"
        )
    if observe is not None:
        observe(0, values[:wanted])
    if len(values) == system.n_dofs - system.rigid.shape[1]:
        # The subspace is the whole space, where Ritz pairs are eigenpairs.
        exact = np.full(wanted, np.finfo(float).eps)
        found = np.ascontiguousarray(start[:, :wanted])
        return Correction(values[:wanted], found, exact, start[:, wanted:])
    iteration = _Iteration(system, inner, Ritz(system, values, start), wanted, acceleration)
    try:
        return iteration.run(tolerance, max_steps, report, observe)
    finally:
        iteration.inverse.destroy()


def default_guard(wanted: int) -> int:
    """Extra vectors that the iteration carries; the more, the faster the last modes converge."""
    return max(FEWEST_GUARDS, int(GUARD_SHARE * wanted))


class _Iteration:
    """State of the subspace iteration."""

    def __init__(
        self, system: System, inner: InnerSolver, ritz: Ritz, wanted: int, acceleration: str
    ) -> None:
        self.system = system
        self.inner = inner
        self.ritz = ritz
        self.wanted = wanted
        self.inside = acceleration == "krylov" and inner.indefinite
        self.inverse: Inverse = inner.inverse(system, self._shift())
        guard = default_guard(wanted)
        self.width = wanted + guard
        self.improved = wanted + int(IMPROVED_GUARDS * guard)
        self.step: Step = enrich
        if acceleration == "relaxation":
            self.width = self.improved = len(ritz.values)
            self.step = relax
        self.solves = 0
        self.history: list[float] = []

    def run(
        self,
        tolerance: float,
        max_steps: int,
        report: Callable[[int, float], None] | None,
        observe: Callable[[int, Array], None] | None,
    ) -> Correction:
        """Correct until the tolerance, or the last step allowed, is reached."""
        step = 0
        while True:
            errors, residual, active = self._residuals(tolerance)
            worst = float(errors.max(initial=0.0))
            self.history.append(worst)
            if report is not None:
                report(step, worst)
            if worst <= tolerance or step >= max_steps:
                break
            if tolerance > 0.0:
                self._require_progress(step, tolerance)
            self._follow_spectrum()
            residual = np.ascontiguousarray(residual)
            correction = self.inverse.solve(residual)
            self.solves += correction.shape[1]
            self.step(self.system, self.ritz, correction, active, self.inverse, self.width)
            step += 1
            if len(self.ritz.values) < self.wanted:
                raise ConvergenceError(
                    f"the iterated vectors collapsed to {len(self.ritz.values)} independent ones "
                    f"after {step} steps, {self.wanted} modes are wanted; keep more"
                )
            if observe is not None:
                observe(step, np.sort(self.ritz.values)[: self.wanted])
        if tolerance > 0.0 and worst > tolerance:
            raise ConvergenceError(
                f"error correction reached an eigenvalue error of {worst:.1e} after {step} steps, "
                f"{tolerance:.1e} was asked for; allow more steps or keep more modes"
            )
        values, vectors, found = self.ritz.lowest(len(self.ritz.values))
        return Correction(
            values[: self.wanted],
            np.ascontiguousarray(vectors[:, : self.wanted]),
            found[: self.wanted],
            vectors[:, self.wanted :],
            step,
            self.solves,
            self.history,
        )

    def _last(self) -> float:
        """Ritz value of the last wanted mode, the same on all ranks."""
        return float(np.sort(self.ritz.values)[self.wanted - 1])

    def _shift(self) -> float:
        return SHIFT_SHARE * self._last() if self.inside else -safe_shift(self.system)

    def _follow_spectrum(self) -> None:
        """Factorise anew if a start far off has put the shift too high."""
        if self.inside and self.inverse.shift > HIGHEST_SHIFT * self._last():
            self.inverse.destroy()
            self.inverse = self.inner.inverse(self.system, self._shift())

    def _residuals(self, tolerance: float) -> tuple[Array, Array, NDArray[np.int64]]:
        """Errors of the wanted modes, and residuals of those to improve with their numbers.

        Wanted modes that have become accurate are locked.
        """
        ritz = self.ritz
        candidates = ritz.active[: max(0, self.improved - ritz.locked)]
        residual = ritz.residual(candidates)
        estimate = self._estimate(candidates, residual)
        ritz.errors[candidates] = on_root(self.system.comm, lambda: estimate)
        inside = candidates[: max(0, self.wanted - ritz.locked)]
        errors = ritz.errors[inside]
        accurate = inside[errors <= tolerance]
        chosen = ~np.isin(candidates, accurate)
        ritz.lock(accurate)
        return errors, residual[:, chosen], candidates[chosen]

    def _estimate(self, candidates: NDArray[np.int64], residual: Array) -> Array:
        values = self.ritz.values[candidates]
        last = np.sort(self.ritz.values)[self._reach()]
        rows = self.system.rows
        mass = rows.lumped_mass if rows.has_diagonal_mass else ROUGH_MASS * rows.lumped_mass
        weighted = residual / np.repeat(mass, 3)[:, None]
        square = self.system.column_products(residual, weighted)
        distance = np.maximum(last - values, np.finfo(float).eps * last)
        return np.maximum(square / (values * distance), np.finfo(float).eps)

    def _reach(self) -> int:
        """Number of the value up to which the subspace holds all that is there."""
        held = len(self.ritz.values)
        if self.step is enrich:
            return min(self.improved, held) - 1
        return (3 * self.wanted + held) // 4

    def _require_progress(self, step: int, tolerance: float) -> None:
        recent = self.history[-STAGNATION - 1 :]
        if len(recent) > STAGNATION and recent[-1] > PROGRESS * max(recent[:-1]):
            raise ConvergenceError(
                f"error correction stagnates at an eigenvalue error of {min(self.history):.1e} "
                f"after {step} steps, {tolerance:.1e} was asked for; use another inner solver "
                "(--inner) or a looser tolerance"
            )
