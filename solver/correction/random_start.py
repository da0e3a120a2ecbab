"""Modes of which little is known: block Lanczos from random vectors, or modes of a coarser mesh."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from carillon.arrays import Array
from carillon.errors import ConvergenceError
from carillon.fem.model import RIGID_MODES
from solver.assembly.system import System
from solver.correction.lanczos import Lanczos, lanczos, mixed
from solver.correction.shift import AIM, inverse_amid, is_amid
from solver.linear import Inverse, LinearSolver
from solver.subspace.start import start_block
from solver.subspace.weyl import CountingLaw

MODES_OF_EIGHT, FEWEST_COLUMNS, MOST_COLUMNS = 100, 8, 24
"""Number of modes for every eight columns of the first block, and its least and greatest width. A
narrower block takes fewer right-hand sides."""
NEAR = 20_000
"""Number of unknowns beyond which a factorisation leaves the cache, and sixteen columns take as
long as eight."""
RANDOM_LOOK = 1.75
"""Dimension of the space at the first look, as a multiple of the modes requested."""
ATTEMPTS, OFF_RESONANCE = 3, 0.97
"""Number of shifts that are tried, and the factor that moves the next off an eigenvalue."""


@dataclass(frozen=True)
class Approximation:
    """Modes of a coarser model."""

    values: Array
    """(q,) its elastic eigenvalues [rad^2/s^2], which are about those of the fine model."""
    vectors: Callable[[], Array]
    """Makes its modes (local, q) on the fine mesh, which are far too stiff there; collective."""
    inverse: Inverse | None = None
    """Inverse of the fine model's K - mu M, used if mu lies amid the wanted eigenvalues; the
    iteration owns it then."""


@dataclass
class LanczosStart:
    """Result of a block Lanczos iteration, and the inverse that it was found with."""

    result: Lanczos
    inverse: Inverse


def from_nothing(
    system: System,
    linear: LinearSolver,
    requested: int,
    accurate: int,
    width: int,
    law: CountingLaw,
    tolerance: float,
    seed: int = 0,
    near: Approximation | None = None,
) -> LanczosStart:
    """Lowest elastic modes from random vectors, or from the modes of a coarser model.

    Raises ConvergenceError if every shift is an eigenvalue.

    Parameters
    ----------
    requested, accurate, width
        Number of modes requested, of those to become accurate, and of those to return.
    law
        Where eigenvalues are expected, for the shift.
    seed
        Of the random vectors, which do not depend on the number of ranks.
    near
        Modes to begin with, more than requested.

    Notes
    -----
    Where no shift with enough eigenvalues above it was found, the next one lies amid those that the
    iteration found, of which the last is an upper bound.
    """
    elastic = system.n_dofs - system.rigid.shape[1]
    columns = min(_columns(requested, system.n_dofs), elastic)
    start, look = start_block(system, columns, seed), int(RANDOM_LOOK * requested)
    share, last = AIM, None
    given = None if near is None else near.inverse
    for attempt in range(ATTEMPTS):
        if given is not None and is_amid(given, requested, system.n_rigid):
            inverse = given
        elif last is None:
            first = None if near is None else float(near.values[int(share * requested)])
            inverse = inverse_amid(system, linear, requested, law, share, first)
        else:
            inverse = linear.inverse(system, share * last)
        given = None
        if near is not None:
            start, look = mixed(
                system, near.values, near.vectors(), requested, inverse.shift, tolerance, columns
            )
        elif system.n_rigid < RIGID_MODES:
            # Stiff springs hold points, which random vectors move far.
            start = inverse.solve(system.times_mass(start))
        result = lanczos(system, inverse, start, accurate, width, tolerance, look, seed + 1)
        if result.too_high and attempt < ATTEMPTS - 1:
            last = float(result.values[requested - 1])
        elif not result.resonant:
            return LanczosStart(replace(result, errors=result.errors[:requested]), inverse)
        inverse.destroy()
        share *= OFF_RESONANCE
    raise ConvergenceError(
        f"{ATTEMPTS} shifts amid the wanted eigenvalues were too close to one; use --method hcms"
    )


def _columns(requested: int, n_dofs: int) -> int:
    fewest = FEWEST_COLUMNS if n_dofs <= NEAR else 2 * FEWEST_COLUMNS
    return min(max(8 * -(-requested // MODES_OF_EIGHT), fewest), MOST_COLUMNS)
