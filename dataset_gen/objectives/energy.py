"""Objective `energy`: the paper's Eq. (8) in closed form.

For a self-equilibrated force f the fine energy is `f^T K(e)^+ f` and the coarse one
`(P^T f)^T K_c(E)^+ (P^T f)`. For Gaussian f and symmetric A the mean of `(f^T A f)^2` is
`2 |A|_F^2 + tr(A)^2`, so no force is sampled. Everything that depends on E lives on the coarse
element's 18 straining motions.
"""

from __future__ import annotations

import numba
import numpy as np

from dataset_gen.element import Array
from dataset_gen.objectives.patterns import corner_strains, pattern_of, straining_motions
from dataset_gen.objectives.quadratic import MODULUS_FLOOR, PatternFits, reference_moduli

MODULUS_CEILING = 10.0
"""Upper bound of every coarse modulus, as a multiple of the block's largest fine modulus."""

LOG_RIDGE = 1e-6
"""Pull of log E towards log E0, as a share of the fine energies' mean square."""

MAX_ITERATIONS = 200
STEP_TOLERANCE = 1e-6
LARGEST_STEP = 1.0


@numba.njit(cache=True, nogil=True)
def _compliance(young: Array, strains: Array) -> Array:
    """Inverse (18, 18) of the coarse stiffness on the straining motions."""
    stiffness = np.zeros((strains.shape[1], strains.shape[1]))
    for q in range(8):
        part = strains[6 * q : 6 * q + 6]
        stiffness += young[q] * (part.T @ part)
    return np.linalg.inv(stiffness)


@numba.njit(cache=True, nogil=True)
def _mismatch(
    compliance: Array, gram: Array, flexibility: Array, trace: float, square: float
) -> float:
    """`2 |B - K^+|_F^2 + (tr B - tr K^+)^2` of the coarse flexibility B."""
    scaled = compliance @ gram
    norm = (scaled * scaled.T).sum() - 2.0 * (compliance * flexibility).sum() + square
    return 2.0 * norm + (np.trace(scaled) - trace) ** 2


@numba.njit(cache=True, nogil=True)
def _fit_block(
    start: Array,
    bounds: tuple[float, float],
    strains: Array,
    gram: Array,
    flexibility: Array,
    trace: float,
    square: float,
) -> tuple[Array, float, bool]:
    """Projected Levenberg-Marquardt in log E; returns log E, the mismatch and convergence."""
    weight = LOG_RIDGE * (2.0 * square + trace**2)
    low, high = bounds
    x = np.minimum(np.maximum(start, low), high)
    origin = x.copy()
    compliance = _compliance(np.exp(x), strains)
    value = _mismatch(compliance, gram, flexibility, trace, square)
    cost = value
    damping = 1e-3
    for _ in range(MAX_ITERATIONS):
        young = np.exp(x)
        middle = compliance @ gram @ compliance
        spread = strains @ middle @ strains.T
        miss = compliance @ (gram @ compliance @ gram - flexibility) @ compliance
        error = np.trace(compliance @ gram) - trace
        traces, slopes = np.zeros(8), np.zeros(8)
        for q in range(8):
            part = strains[6 * q : 6 * q + 6]
            traces[q] = -young[q] * np.trace(spread[6 * q : 6 * q + 6, 6 * q : 6 * q + 6])
            slopes[q] = -young[q] * (part @ miss * part).sum()
        gradient = 2.0 * slopes + error * traces + weight * (x - origin)
        hessian = np.zeros((8, 8))
        for p in range(8):
            for q in range(8):
                shared = (spread[6 * p : 6 * p + 6, 6 * q : 6 * q + 6] ** 2).sum()
                hessian[p, q] = 2.0 * young[p] * young[q] * shared + traces[p] * traces[q]
            hessian[p, p] += weight
        held = ((x <= low) & (gradient > 0.0)) | ((x >= high) & (gradient < 0.0))
        for q in np.flatnonzero(held):
            hessian[q, :] = 0.0
            hessian[:, q] = 0.0
            hessian[q, q] = 1.0
            gradient[q] = 0.0
        while True:
            step = -np.linalg.solve(hessian + damping * np.diag(np.diag(hessian)), gradient)
            longest = np.abs(step).max()
            if longest > LARGEST_STEP:
                step *= LARGEST_STEP / longest
            trial = np.minimum(np.maximum(x + step, low), high)
            moved = np.abs(trial - x).max()
            if moved < STEP_TOLERANCE:
                return x, value, True
            trial_compliance = _compliance(np.exp(trial), strains)
            trial_value = _mismatch(trial_compliance, gram, flexibility, trace, square)
            trial_cost = trial_value + weight * ((trial - origin) ** 2).sum()
            if trial_cost <= cost:
                break
            damping *= 4.0
        x, compliance, value, cost = trial, trial_compliance, trial_value, trial_cost
        damping = max(damping / 6.0, 1e-9)
    return x, value, False


@numba.njit(cache=True, nogil=True)
def _fit_all(
    starts: Array,
    bounds: Array,
    strains: Array,
    gram: Array,
    flexibilities: Array,
    traces: Array,
    squares: Array,
) -> tuple[Array, Array, np.ndarray]:
    logs = np.empty_like(starts)
    values = np.empty(len(starts))
    converged = np.empty(len(starts), dtype=np.bool_)
    for row in range(len(starts)):
        logs[row], values[row], converged[row] = _fit_block(
            starts[row],
            (bounds[0], bounds[1]),
            strains,
            gram,
            flexibilities[row],
            traces[row],
            squares[row],
        )
    return logs, values, converged


def _fine_flexibility(young: Array, mask: int, poisson: float) -> Array:
    """K(e)^+ (n, a, a) on the active nodes."""
    pattern = pattern_of(mask, poisson)
    rigid = pattern.null @ pattern.null.T
    shift = young[:, pattern.cells].mean(axis=1)[:, None, None]
    return np.asarray(np.linalg.inv(pattern.assemble(young)) - rigid / shift)


def _loaded_motions(mask: int, poisson: float) -> Array:
    """Straining motions of the corners (a, 18) as self-equilibrated nodal forces feel them."""
    pattern = pattern_of(mask, poisson)
    return pattern.without_null(pattern.interpolation @ straining_motions())


def expected_mismatch(moduli: Array, young: Array, mask: int, poisson: float) -> Array:
    """Mean squared energy difference (n,) of Eq. (8) over standard Gaussian forces.

    `moduli` and `young` are (n, 8); all blocks share the void pattern `mask`.
    """
    flexibility = _fine_flexibility(young, mask, poisson)
    fields = _loaded_motions(mask, poisson)
    strains = corner_strains(poisson) @ straining_motions()
    values = np.empty(len(young))
    for row, fine in enumerate(flexibility):
        values[row] = _mismatch(
            _compliance(moduli[row], strains),
            fields.T @ fields,
            np.ascontiguousarray(fields.T @ fine @ fields),
            np.trace(fine),
            (fine * fine).sum(),
        )
    return values


def fit_pattern(young: Array, mask: int, poisson: float) -> PatternFits:
    """Fit blocks (n, 8) that share one void pattern."""
    largest = young.max(axis=1)
    scaled = young / largest[:, None]
    inverse = _fine_flexibility(scaled, mask, poisson)
    fields = _loaded_motions(mask, poisson)
    traces = np.einsum("nii->n", inverse)
    squares = (inverse * inverse).sum(axis=(1, 2))
    logs, values, converged = _fit_all(
        np.log(reference_moduli(scaled)),
        np.log(np.array([MODULUS_FLOOR, MODULUS_CEILING])),
        corner_strains(poisson) @ straining_motions(),
        fields.T @ fields,
        np.ascontiguousarray(fields.T @ inverse @ fields),
        traces,
        squares,
    )
    residual = np.sqrt(np.maximum(values, 0.0) / (2.0 * squares + traces**2))
    return PatternFits(np.exp(logs) * largest[:, None], residual, converged)
