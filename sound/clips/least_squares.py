"""Least-squares fits of damped sinusoids to a signal; `sound.synthesis.sinusoids` has the symbols.

Sums of products of two damped sinusoids have closed forms, so the normal equations of a fit cost
nothing beside its right-hand side.
"""

import numpy as np
import scipy.linalg as la

from carillon.arrays import Array, Complex
from sound.synthesis.sinusoids import correlations, superposed

_MOST_GROWTH = 40.0
"""Greatest growth of a sinusoid within the signal [nepers]; sums would overflow beyond."""
_CLOSEST = 1e-3
"""Least magnitude of an exponent, times the number of samples, in the closed forms."""
_FIRST_DAMPING, _LEAST_DAMPING = 1e-3, 1e-6
"""Levenberg-Marquardt damping of the first step, and the least after a step that failed."""
_CONVERGED = 1e-9
"""Relative decrease of the squared rest at which steps end."""
_WELL_CONDITIONED = 1e-5
"""Least diagonal entry of a Cholesky factor by which a matrix is inverted."""


def normal_matrix(exponents: Complex, directions: Complex, count: int, order: int = 2) -> Array:
    """Normal matrix (2 order k, 2 order k) of Re(A w) for complex unknowns w (order k,).

    Columns of A are exp(lambda_k n) and, with order 2, directions_k n exp(lambda_k n): what a
    small change of c_k and of lambda_k adds if `directions` are the coefficients.  Rows of the
    result are the real parts of w, then the imaginary parts.
    """
    conjugate = _gram(exponents.conj(), exponents, directions.conj(), directions, count, order)
    plain = _gram(exponents, exponents, directions, directions, count, order)
    both, difference = 0.5 * (conjugate + plain), 0.5 * (conjugate - plain)
    return np.block([[both.real, -both.imag], [-both.imag.T, difference.real]])


def _gram(
    left: Complex, right: Complex, c_left: Complex, c_right: Complex, count: int, order: int
) -> Complex:
    sums = _power_sums(left[:, None] + right[None, :], count)
    if order == 1:
        return sums[0]
    return np.block(
        [
            [sums[0], sums[1] * c_right],
            [c_left[:, None] * sums[1], c_left[:, None] * sums[2] * c_right],
        ]
    )


def _power_sums(exponents: Complex, count: int) -> tuple[Complex, Complex, Complex]:
    """Sums of n^m exp(mu n) over n = 0 .. count - 1 for m = 0, 1, 2.

    These are derivatives of a geometric series.  Exponents too close to 0 for its quotients are
    moved a little away from there.
    """
    near = np.abs(exponents) * count < _CLOSEST
    mu = np.where(near, -_CLOSEST / count, exponents)
    last = np.exp(mu * count)
    below, slope = np.expm1(mu), np.exp(mu)
    zeroth = np.expm1(mu * count) / below
    first = (count * last - zeroth * slope) / below
    second = (count**2 * last - (2.0 * first + zeroth) * slope) / below
    return zeroth, first, second


def solved(matrix: Array, right: Complex, damping: float = 1e-13) -> Complex:
    """Complex unknowns w of real normal equations with Levenberg-Marquardt damping.

    The matrix (2 n, 2 n) is a `normal_matrix`, to which a share `damping` of its diagonal is added;
    the right-hand side (n,) is A^T r of a signal r.
    """
    values = inverse(matrix, damping) @ np.concatenate([right.real, -right.imag])
    half = len(right)
    return np.asarray(values[:half] + 1j * values[half:])


def inverse(matrix: Array, damping: float = 1e-13) -> Array:
    """Inverse of a normal matrix plus a share `damping` of its diagonal."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(matrix), np.finfo(float).tiny))
    scaled = matrix * scale * scale[:, None]
    scaled[np.diag_indices_from(scaled)] += damping
    if not len(scaled):
        return scaled
    factor, failed = la.lapack.dpotrf(scaled, lower=True)
    if failed or np.diag(factor).min() < _WELL_CONDITIONED:
        inverted = la.pinvh(scaled)
    else:
        lower, _ = la.lapack.dpotri(factor, lower=True)
        inverted = lower + np.tril(lower, -1).T
    return np.asarray(inverted * scale * scale[:, None])


def fitted_coefficients(exponents: Complex, signal: Array) -> Complex:
    """Coefficients (k,) that fit `signal` best, its exponents given."""
    count = len(signal)
    matrix = normal_matrix(exponents, np.ones(len(exponents), complex), count, order=1)
    coefficients = solved(matrix, correlations(exponents, signal)[0])
    rest = signal - superposed(exponents, coefficients, count)
    return coefficients + solved(matrix, correlations(exponents, rest)[0])


def refined(
    exponents: Complex, coefficients: Complex, signal: Array, steps: int
) -> tuple[Complex, Complex]:
    """Exponents and coefficients (k,) after Levenberg-Marquardt steps of least squares."""
    count, damping = len(signal), _FIRST_DAMPING
    rest = signal - superposed(exponents, coefficients, count)
    for _ in range(steps):
        matrix = normal_matrix(exponents, coefficients, count)
        sums = correlations(exponents, rest)
        step = solved(matrix, np.concatenate([sums[0], sums[1] * coefficients]), damping)
        change, move = np.split(step, 2)
        gain = 0.0
        if ((exponents + move).real * count <= _MOST_GROWTH).all():
            new_rest = signal - superposed(exponents + move, coefficients + change, count)
            gain = 1.0 - (new_rest @ new_rest) / max(rest @ rest, np.finfo(float).tiny)
        if not gain > 0.0:  # too long a step
            damping = 100.0 * max(damping, _LEAST_DAMPING)
            continue
        exponents, coefficients, rest = exponents + move, coefficients + change, new_rest
        if gain < _CONVERGED:
            break
        damping *= 0.1
    return exponents, coefficients
