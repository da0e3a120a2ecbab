"""Modes of which nothing is known: block Lanczos from random vectors."""

from __future__ import annotations

from dataclasses import dataclass

from carillon.errors import ConvergenceError
from solver.assembly.system import System
from solver.correction.lanczos import RANDOM_LOOK, Lanczos, lanczos
from solver.correction.shift import AIM, inverse_amid
from solver.linear import Inverse, LinearSolver
from solver.subspace.start import start_block
from solver.subspace.weyl import CountingLaw

MODES_OF_EIGHT, FEWEST_COLUMNS, MOST_COLUMNS = 100, 8, 24
"""Modes for every eight columns of the first block, and its least and greatest width: the narrower,
the fewer right-hand sides."""
NEAR = 20_000
"""Unknowns beyond which a factorisation leaves the cache, and eight columns take as long as twice
as many."""
ATTEMPTS, OFF_RESONANCE = 3, 0.97
"""Shifts that are tried, and by what the next is moved off an eigenvalue that one has hit."""


@dataclass
class Cold:
    """What was found, and the inverse that it was found with."""

    found: Lanczos
    inverse: Inverse


def from_nothing(
    system: System,
    linear: LinearSolver,
    requested: int,
    width: int,
    law: CountingLaw,
    tolerance: float,
    seed: int = 0,
) -> Cold:
    """Lowest elastic modes from random vectors.

    Parameters
    ----------
    requested, width
        Modes to become accurate, and to return.
    law
        Where eigenvalues are expected, for the shift.
    tolerance
        Relative eigenvalue error to stop at.
    seed
        Of the random vectors, which do not depend on the number of ranks.

    Raises
    ------
    ConvergenceError
        If every shift is an eigenvalue.
    """
    elastic = system.n_dofs - system.rigid.shape[1]
    start = start_block(system, min(_columns(requested, system.n_dofs), elastic), seed)
    share = AIM
    for _ in range(ATTEMPTS):
        inverse = inverse_amid(system, linear, requested, law, share)
        look = int(RANDOM_LOOK * requested)
        found = lanczos(system, inverse, start, requested, width, tolerance, look)
        if not found.resonant:
            return Cold(found, inverse)
        inverse.destroy()
        share *= OFF_RESONANCE
    raise ConvergenceError(
        f"{ATTEMPTS} shifts amid the wanted eigenvalues were too close to one; use --method hcms"
    )


def _columns(requested: int, n_dofs: int) -> int:
    """Width of the first block, in whole vector registers."""
    fewest = FEWEST_COLUMNS if n_dofs <= NEAR else 2 * FEWEST_COLUMNS
    return min(max(8 * -(-requested // MODES_OF_EIGHT), fewest), MOST_COLUMNS)
