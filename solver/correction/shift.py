"""A shift amid the wanted eigenvalues, without knowing any: those below are counted by inertia."""

from math import exp, inf, log

from solver.assembly.system import System
from solver.linear import Inverse, LinearSolver
from solver.subspace.weyl import CountingLaw

AIM, LEAST, MOST = 0.56, 0.3, 0.72
"""Share of the requested eigenvalues that should lie below the shift, and the range that is as
good, since a further factorisation would cost more than it saves."""
TRIES, MOST_TRIES = 4, 8
"""Number of factorisations after which few eigenvalues below a shift suffice, and their largest
number."""
CROWDED = 1.5
"""Ratio of shifts with too many and too few eigenvalues below up to which too few suffice."""


def inverse_amid(
    system: System,
    linear: LinearSolver,
    requested: int,
    law: CountingLaw,
    share: float = AIM,
    first: float | None = None,
) -> Inverse:
    """Inverse of K - mu M, a share of the `requested` lowest elastic eigenvalues below mu.

    Parameters
    ----------
    law
        Where eigenvalues are expected; a factor of its own is found as counts come in, and between
        two counts the law is a power.
    first
        Shift to begin with, if more is known than the law.
    """
    rigid = system.n_rigid
    target = share * requested + rigid
    # Shifts with too few and with too many eigenvalues below, and how many these are.
    low, high = (0.0, 0), (inf, 0)
    shift = first or law.eigenvalue(target)
    for attempt in range(MOST_TRIES):
        inverse = linear.inverse(system, shift)
        below = inverse.negative - rigid
        few = below < LEAST * requested and high[0] > CROWDED * shift
        if below <= MOST * requested and (attempt >= TRIES - 1 or not few):
            break
        if attempt == MOST_TRIES - 1:
            break
        inverse.destroy()
        low, high = ((shift, below), high) if few else (low, (shift, below))
        if low[0] > 0.0 and high[0] < inf:
            # A crowd of eigenvalues is left behind at last.
            shift = (
                _between(low, high, target, rigid) if attempt < TRIES else (low[0] * high[0]) ** 0.5
            )
        else:
            shift *= law.eigenvalue(target) / law.eigenvalue(below + rigid)
    return inverse


def _between(low: tuple[float, int], high: tuple[float, int], target: float, rigid: int) -> float:
    """Shift that about `target` eigenvalues lie below, from two shifts and their counts."""
    below, above = (log(max(count + rigid, 1)) for _, count in (low, high))
    place = (log(target) - below) / (above - below)
    return exp((1.0 - place) * log(low[0]) + place * log(high[0]))


def is_amid(inverse: Inverse, requested: int, rigid: int) -> bool:
    """Whether the shift lies amid the `requested` lowest elastic eigenvalues.

    `rigid` is the number of rigid motions.
    """
    return LEAST * requested <= inverse.negative - rigid <= MOST * requested
