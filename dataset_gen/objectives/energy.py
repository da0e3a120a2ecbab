"""Objective `energy`: the paper's Eq. (8) in closed form.

For a self-equilibrated force f the fine energy is `f^T K(e)^+ f` and the coarse one
`(P^T f)^T K_c(E)^+ (P^T f)`. For Gaussian f and symmetric A the mean of `(f^T A f)^2` is
`2 |A|_F^2 + tr(A)^2`, so no force is sampled. Everything that depends on E lives on the coarse
element's 18 straining motions; in a basis V of what nodal forces feel of them, orthonormal on the
active nodes, the coarse flexibility is `V B V^T` with `B(E) = (sum_q E_q A_q)^-1`.
"""

from typing import NamedTuple

import numpy as np

from carillon.arrays import Array, Flags
from carillon.numerics.simd import LANES, Vector, empty, load, spread, store
from dataset_gen.objectives.coarse_response import (
    Coarse,
    CoarseResponse,
    coarse_of,
    empty_response,
    respond,
    write_derivatives,
)
from dataset_gen.objectives.compiled import compiled
from dataset_gen.objectives.descent import (
    GRADIENT,
    HESSIAN,
    MAX_ITERATIONS,
    VALUE,
    begin,
    converged,
    judge,
    propose,
    start,
)
from dataset_gen.objectives.elimination import TILE
from dataset_gen.objectives.free_block import flexibility_norms, squares
from dataset_gen.objectives.kernel import (
    MOTIONS,
    WEIGHTS,
    add_diagonal,
    assemble,
    copy_in,
    element_forms,
    factorise,
    form_sizes,
    inner_products,
    matrix_form,
    multiply,
    solve_lower,
    trace,
    weigh,
)
from dataset_gen.objectives.quadratic import MODULUS_FLOOR, PatternFits, reference_moduli

MODULUS_CEILING = 10.0
"""Upper bound of every coarse modulus, as a multiple of the block's largest fine modulus."""
LOG_RIDGE = 1e-6
"""Pull of log E towards log E0, as a share of the fine energies' mean square."""


class Fine(NamedTuple):
    """Fine flexibility of the blocks in the lanes."""

    flexibility: Array
    """(18, 18) V^T K^+ V."""
    norms: Array
    """(3) trace of K^+, mean square of the energies f^T K^+ f, and the part of it that no coarse
    element can answer, twice |K^+|^2 - |V^T K^+ V|^2."""


@compiled
def _fine_response(coarse: Coarse, young: Array, first: int, fine: Fine) -> None:
    """Fine flexibility of the blocks from row `first` on."""
    factor, stiffness, _ = coarse.block
    size = 3 * len(factor.diagonal)
    weights, tiles = empty(WEIGHTS), empty(TILE * (len(stiffness.start) - 1))
    u = empty(MOTIONS * size)
    weigh(young, first, weights)
    assemble(stiffness, weights, tiles)
    factorise(factor, tiles)
    copy_in(coarse.basis, u)
    solve_lower(factor, tiles, u, MOTIONS)
    columns = (u, 0, 1, MOTIONS)
    multiply(fine.flexibility, columns, columns, MOTIONS, MOTIONS, size)
    total, square = flexibility_norms(coarse.block, tiles)
    answered = squares(fine.flexibility, 0, MOTIONS**2)
    store(fine.norms, 0, total)
    store(fine.norms, 1, spread(2.0) * square + total * total)
    store(fine.norms, 2, spread(2.0) * (square - answered))


@compiled
def _evaluate(
    coarse: Coarse, fine: Fine, response: CoarseResponse, forms: Array, logs: Array, out: Array
) -> None:
    """Value, gradient and Hessian of `2 |B - V^T K^+ V|^2 + (tr B - tr K^+)^2` in log E."""
    respond(coarse, logs, response)
    gram, slope, size = empty(81), empty(MOTIONS**2), form_sizes(MOTIONS)[2]
    for n in range(MOTIONS**2):
        store(slope, n, load(response.flexibility, n) - load(fine.flexibility, n))
    element_forms(response.strained, MOTIONS, forms)
    matrix_form(slope, MOTIONS, forms, 8)
    error = trace(response.flexibility, MOTIONS) - load(fine.norms, 0)
    store(forms, 9 * size - 1, error)
    inner_products(forms, MOTIONS, gram)
    for n in range(MOTIONS**2):
        store(slope, n, spread(4.0) * load(slope, n))
    add_diagonal(slope, MOTIONS, spread(2.0) * error)
    write_derivatives(response, gram, slope, out)


@compiled
def _add_pull(origin: Array, weight: Vector, logs: Array, out: Array) -> None:
    """Add `weight |log E - log E0|^2` to value, gradient and Hessian."""
    value = load(out, VALUE)
    for i in range(8):
        away = load(logs, i) - load(origin, i)
        value = value + weight * away * away
        store(out, GRADIENT + i, load(out, GRADIENT + i) + spread(2.0) * weight * away)
        at = HESSIAN + 9 * i
        store(out, at, load(out, at) + spread(2.0) * weight)
    store(out, VALUE, value)


@compiled
def _fit_rows(
    coarse: Coarse, young: Array, starts: Array, bounds: tuple[float, float]
) -> tuple[Array, Array, Flags]:
    """Logarithms (n, 8) of the moduli, residuals (n,) and convergence (n,)."""
    count = len(young)
    logs, residuals = np.empty((count, 8)), np.empty(count)
    flags = np.empty(count, dtype=np.bool_)
    fine, response = Fine(empty(MOTIONS**2), empty(3)), empty_response()
    forms, origin, state = empty(9 * form_sizes(MOTIONS)[2]), empty(8), begin(*bounds)
    for first in range(0, count, LANES):
        _fine_response(coarse, young, first, fine)
        store(state.scale, 0, load(fine.norms, 1))
        pull = load(fine.norms, 1) * spread(LOG_RIDGE)
        for lane in range(LANES):
            for i in range(8):
                begun = starts[min(first + lane, count - 1), i]
                state.trial[i, lane] = origin[i, lane] = min(max(begun, bounds[0]), bounds[1])
        _evaluate(coarse, fine, response, forms, state.trial, state.there)
        _add_pull(origin, pull, state.trial, state.there)
        start(state)
        for _ in range(MAX_ITERATIONS):
            propose(state)
            _evaluate(coarse, fine, response, forms, state.trial, state.there)
            _add_pull(origin, pull, state.trial, state.there)
            if judge(state):
                break
        for lane in range(min(LANES, count - first)):
            row = first + lane
            flags[row] = converged(state, lane)
            left = state.here[VALUE, lane] + fine.norms[2, lane]
            for i in range(8):
                logs[row, i] = state.x[i, lane]
                left -= LOG_RIDGE * fine.norms[1, lane] * (state.x[i, lane] - origin[i, lane]) ** 2
            residuals[row] = np.sqrt(max(left, 0.0) / fine.norms[1, lane])
    return logs, residuals, flags


def fit_pattern(young: Array, mask: int, poisson: float) -> PatternFits:
    """Fit blocks (n, 8) that share one void pattern."""
    largest = young.max(axis=1)
    scaled = young / largest[:, None]
    starts = np.log(reference_moduli(scaled))
    bounds = float(np.log(MODULUS_FLOOR)), float(np.log(MODULUS_CEILING))
    logs, residual, flags = _fit_rows(coarse_of(mask, poisson), scaled, starts, bounds)
    return PatternFits(np.exp(logs) * largest[:, None], residual, flags)
