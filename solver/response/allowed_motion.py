"""By how much the motion after a strike may differ if eigenvalues are accurate to a tolerance."""

import numpy as np

from carillon.arrays import Array
from solver.response.response import Contacts, Damping, displacements, impulse_responses

INSTANTS = 150
"""Largest number of instants at which the bound is taken."""


def motion_limit(
    seen: Contacts, errors: Array, damping: Damping, seconds: Array, unknowns: int
) -> float:
    """Largest relative difference of the motion after a strike, to first order.

    Parameters
    ----------
    seen
        Exact modes at the struck point, the watched one, and maybe more.
    errors
        (k,) accepted errors of the eigenvalues [rad^2/s^2], see
        `solver.verification.allowance.accepted_errors`.
    unknowns
        Of the model: so many modes there are.

    Notes
    -----
    A mode x_j of the candidate holds c_ij of the exact mode i > j, and by orthogonality x_i holds
    -c_ij of j.  The first k eigenvalues then err, together, by the sum of c_ij^2 (lambda_i -
    lambda_j) over all pairs j <= k < i, which is at most E_k, the sum of their `errors`.  The
    motion differs by c_ij (f_i - f_j) times what both modes move at the two points, f being the
    response of a mode to an impulse.  Cauchy's inequality bounds the sum over all pairs, with any
    weights p_k of the bounds that add up to one; here they grow as the root of E_k.  The modes that
    nobody computed are taken to move the points as much as the others do on average, and to lie
    where Weyl's law has them.
    """
    seconds = seconds[:: -(-len(seconds) // INSTANTS)]
    values, count = seen.eigenvalues, len(seen.eigenvalues)
    total = np.cumsum(errors)
    share = np.sqrt(total) / np.sqrt(total).sum()
    # Of mode j and later, so that the difference of two is the sum over all k between them.
    weight = np.cumsum((share / total)[::-1])[::-1]
    moved = impulse_responses(values, damping, seconds)
    push, motion = np.abs(seen.push[0]), np.linalg.norm(seen.motion[1], axis=0)
    beyond = 3.0 * ((unknowns / count) ** (1.0 / 3.0) - 1.0) * count / values[-1]
    mean = np.sqrt((push**2).mean()), np.sqrt((motion**2).mean())
    square = np.zeros(len(seconds))
    for mode in range(count):
        later = slice(mode + 1, None)
        apart = np.maximum(values[later] - values[mode], np.finfo(float).eps * values[mode])
        both = motion[mode] * push[later] + push[mode] * motion[later]
        bound = both**2 / (apart * (weight[mode] - weight[later]))
        square += (moved[:, later] - moved[:, [mode]]) ** 2 @ bound
        both = motion[mode] * mean[0] + push[mode] * mean[1]
        square += moved[:, mode] ** 2 * beyond * both**2 / weight[mode]
    difference = np.sqrt(square) + _out_of_step(seen, errors, damping, seconds)
    length = np.linalg.norm(displacements(seen, damping, seconds))
    return float(np.linalg.norm(difference) / length)


def _out_of_step(seen: Contacts, errors: Array, damping: Damping, seconds: Array) -> Array:
    """Difference (t,) by frequencies and dampings that are off, and shapes that are not."""
    values = seen.eigenvalues
    decay = damping.decay_per_second(values)
    damped = np.sqrt(np.abs(values - decay**2))
    slowest = decay - np.where(values < decay**2, damped, 0.0)
    t = seconds[:, None]
    size = np.exp(-slowest * t) * np.minimum(t, 1.0 / np.maximum(damped, np.finfo(float).tiny))
    slope = np.sqrt(values) * t + 1.0 + damping.stiffness_seconds * values * t
    step = np.minimum(2.0, 0.5 * (errors / values) * slope)
    return np.asarray(
        (size * step) @ (np.abs(seen.push[0]) * np.linalg.norm(seen.motion[1], axis=0))
    )
