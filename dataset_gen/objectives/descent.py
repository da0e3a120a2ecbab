"""Damped Newton steps in the logarithms of eight bounded moduli, `LANES` problems at a time.

The caller evaluates its objective at `trial` between `propose` and `judge`; each lane takes its own
steps and stops on its own. Far from the end the steps are those of Gauss and Newton, near it they
use all of the Hessian. Eq. (8) has saddles where a block is symmetric: nearly symmetric blocks
leave them, symmetric ones, which have no reason to prefer a side, end there.
"""

from typing import NamedTuple

import numpy as np

from carillon.arrays import Array
from carillon.numerics.simd import LANES, Vector, empty, larger, load, spread, store, where_less
from dataset_gen.objectives.bounded import solve_free
from dataset_gen.objectives.compiled import compiled

MAX_ITERATIONS = 100

STEP_TOLERANCE = 1e-6
"""Newton step in log E that ends a descent; the error that is left is of the order of its square.

It only counts while the damping is at most `LIGHT`, when the step is close to Newton's.
"""
LIGHT = 1e-2

FIRST_DAMPING, LEAST_DAMPING, REFUSED = 1e-2, 1e-6, 1e-3
"""Share of the diagonal added to the Hessian: at the start, at least, and after a refused step."""
LARGEST_STEP = 1.0
"""Longest step in log E of Gauss and Newton."""
NEAR = 0.2
"""Step of Gauss and Newton from which on all of the Hessian is used; the longest such step."""
FIRST_SHIFT, SHIFTS = 3e-5, 16
"""First shift of a Hessian that is not positive, and how often it is doubled until it is."""
SLACK = 1e-12
"""Rise of the cost taken for rounding, as a share of the objective's scale."""


class DescentState(NamedTuple):
    """State of the lanes: where they are, what they try, and the objective at both."""

    bounds: Array
    """(2) of log E, in all lanes."""
    x: Array
    trial: Array
    """(8) logarithms of the moduli."""
    here: Array
    there: Array
    """At x and at trial, one after the other: value (1), gradient (8), the Hessian of Gauss and
    Newton (8, 8), and what it lacks (8, 8); of both only the lower half."""
    scale: Array
    """(1) size of the objective at E = 0."""
    damping: Array
    """(1) share of the Hessian's diagonal that is added to it."""
    left: Array
    """(1) length of the step of Gauss and Newton."""
    active: Array
    """(1) 1 until the lane has converged, then 0."""


VALUE, GRADIENT, HESSIAN, CURVATURE, DERIVATIVES = 0, 1, 9, 73, 137
"""Offsets of the parts of `here` and `there`, and the count of their numbers."""


@compiled
def begin(low: float, high: float) -> DescentState:
    """State with room for everything."""
    state = DescentState(
        empty(2),
        empty(8),
        empty(8),
        empty(DERIVATIVES),
        empty(DERIVATIVES),
        empty(1),
        empty(1),
        empty(1),
        empty(1),
    )
    store(state.bounds, 0, spread(low))
    store(state.bounds, 1, spread(high))
    return state


@compiled
def start(state: DescentState) -> None:
    """Begin the descent at `trial`, where the objective has just been evaluated."""
    for i in range(8):
        store(state.x, i, load(state.trial, i))
    for n in range(DERIVATIVES):
        store(state.here, n, load(state.there, n))
    store(state.damping, 0, spread(FIRST_DAMPING))
    store(state.active, 0, spread(1.0))


@compiled
def _newton_step(state: DescentState, damping: Vector, share: Vector, step: Array) -> Vector:
    """Damped step with `share` of what the Hessian of Gauss and Newton lacks, and its length.

    A modulus at a bound that it would cross is held. The length is infinite where the matrix is not
    positive.
    """
    zero, one = spread(0.0), spread(1.0)
    low, high = load(state.bounds, 0), load(state.bounds, 1)
    matrix, slope, free, factor = empty(64), empty(8), empty(8), empty(64)
    for i in range(8):
        x, gradient = load(state.x, i), load(state.here, GRADIENT + i)
        rising = where_less(low, x, one, where_less(zero, gradient, zero, one))
        store(free, i, where_less(x, high, rising, where_less(gradient, zero, zero, rising)))
        store(slope, i, zero - gradient)
        for n in range(8 * i, 9 * i + 1):
            rest = share * load(state.here, CURVATURE + n)
            store(matrix, n, load(state.here, HESSIAN + n) + rest)
        more = damping * load(state.here, HESSIAN + 9 * i)
        store(matrix, 9 * i, load(matrix, 9 * i) + more)
    solve_free(matrix, slope, free, factor, step)
    length, infinite = zero, spread(np.inf)
    for i in range(8):
        size = larger(load(step, i), zero - load(step, i))
        size = where_less(size, infinite, size, infinite)
        length = larger(length, size)
    return length


@compiled
def _curved_step(state: DescentState, step: Array) -> Vector:
    """Newton's step with all of the Hessian, and its length.

    Where the Hessian is not positive, it is shifted by half as much again as makes it so: near a
    saddle the distance from it then grows threefold at most, and a symmetry of the block, which
    rounding breaks by 1e-16, outlasts the descent.
    """
    damping, shift, one = load(state.damping, 0), empty(1), spread(1.0)
    store(shift, 0, damping)
    length = _newton_step(state, damping, one, step)
    for _ in range(SHIFTS):
        more = larger(load(shift, 0) * spread(2.0), spread(FIRST_SHIFT))
        store(shift, 0, where_less(length, spread(np.inf), load(shift, 0), more))
        length = _newton_step(state, load(shift, 0), one, step)
        worst = empty(1)
        store(worst, 0, length)
        if worst.max() < np.inf:
            break
    raised = where_less(damping, load(shift, 0), spread(1.5), one)
    return _newton_step(state, load(shift, 0) * raised, one, step)


@compiled
def propose(state: DescentState) -> None:
    """Write the next point of each lane to `trial`: far from the end by Gauss and Newton."""
    zero, one, far = spread(0.0), spread(1.0), spread(NEAR)
    low, high = load(state.bounds, 0), load(state.bounds, 1)
    step, curved = empty(8), empty(8)
    length = _newton_step(state, load(state.damping, 0), zero, step)
    store(state.left, 0, length)
    other = _curved_step(state, curved)
    plain = where_less(length, far, where_less(other, spread(np.inf), zero, one), one)
    length = where_less(zero, plain, length, other)
    limit = where_less(zero, plain, spread(LARGEST_STEP), far)
    ratio = limit / larger(length, limit)
    for i in range(8):
        there = where_less(zero, plain, load(step, i), load(curved, i))
        there = load(state.x, i) + there * ratio
        there = where_less(there, low, low, there)
        store(state.trial, i, where_less(high, there, high, there))


@compiled
def judge(state: DescentState) -> bool:
    """Accept or refuse each lane's trial; whether all lanes have converged."""
    zero = spread(0.0)
    damping, active = load(state.damping, 0), load(state.active, 0)
    moved = load(state.left, 0)
    for i in range(8):
        step = load(state.trial, i) - load(state.x, i)
        moved = larger(moved, larger(step, zero - step))
    ceiling = load(state.here, VALUE) + spread(SLACK) * load(state.scale, 0)
    better = where_less(load(state.there, VALUE), ceiling, active, zero)
    for i in range(8):
        moving = where_less(zero, better, load(state.trial, i), load(state.x, i))
        store(state.x, i, moving)
    for n in range(DERIVATIVES):
        known = where_less(zero, better, load(state.there, n), load(state.here, n))
        store(state.here, n, known)
    settled = where_less(moved, spread(STEP_TOLERANCE), better, zero)
    settled = where_less(spread(LIGHT), damping, zero, settled)
    store(state.active, 0, active - settled)
    smaller = larger(damping * spread(0.1), spread(LEAST_DAMPING))
    greater = larger(damping * spread(4.0), spread(REFUSED))
    store(state.damping, 0, where_less(zero, better, smaller, greater))
    for lane in range(LANES):
        if state.active[0, lane] != 0.0:
            return False
    return True


@compiled
def converged(state: DescentState, lane: int) -> bool:
    """Whether a lane has stopped on its own, at finite moduli."""
    finite = True
    for i in range(8):
        finite &= np.isfinite(state.x[i, lane])
    return finite and state.active[0, lane] == 0.0
