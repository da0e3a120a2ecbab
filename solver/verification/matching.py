"""Which mode of one solution is which of another, by shape or by index, and how far they differ."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.optimize import linear_sum_assignment

from carillon.arrays import Array, Index
from carillon.fem.model import RIGID_MODES

SAME = 0.5
"""Least overlap of two modes that count as the same."""
DEPENDENT = 1e-10
"""Share of the largest eigenvalue of a Gram matrix below which vectors are dependent."""

AUDIBLE_FIRST, AUDIBLE_LAST = 7, 60
"""Mode numbers, from 1, of the frequency errors that are reported for coarsened models."""


@dataclass(frozen=True)
class Matching:
    """The mode of another solution that each mode of the truth is, no two the same."""

    partners: Index
    """(k,) indices among the other solution's modes."""
    overlaps: Array
    """(k,) with the partner: 1 for the same shape, 0 for an orthogonal one."""
    largest: Array
    """(k,) with any mode of the other solution."""


def mode_overlaps(modes: Array, others: Array, weighted: Array) -> Array:
    """Overlaps |v^T M w| (k, l) of modes v (n, k) of unit mass and others w (n, l), made so.

    `others` are on the truth's nodes, and `weighted` their products with its mass matrix.
    """
    norms = np.sqrt((others * weighted).sum(axis=0))
    return np.asarray(np.abs(modes.T @ (weighted / norms)))


def of_clusters(overlaps: Array, rows: list[slice], columns: list[slice]) -> Array:
    """Overlaps (k, l) of the spaces that modes belong to, from those of single modes.

    Modes of a cluster may be mixed, by which they resemble no single mode of the other solution.
    Each has the root mean square of the cosines between both clusters' spaces instead. `rows` and
    `columns` are clusters of the truth and of the other solution, see
    `solver.subspace.weyl.clusters`.

    Examples
    --------
    >>> mixed = np.array([[0.6, 0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
    >>> pairs = [slice(0, 2), slice(2, 3)]
    >>> of_clusters(mixed, pairs, pairs).round(12)
    array([[1., 1., 0.],
           [1., 1., 0.],
           [0., 0., 1.]])
    """
    result = np.empty_like(overlaps)
    for row in rows:
        for column in columns:
            block = overlaps[row, column]
            result[row, column] = np.sqrt((block**2).sum() / min(block.shape))
    return np.minimum(result, 1.0)


def match_modes(overlaps: Array) -> Matching:
    """Pair the rows of overlaps (k, l >= k) with columns so that their sum is largest.

    Examples
    --------
    >>> match_modes(np.array([[0.1, 0.9, 0.0], [0.8, 0.3, 0.1]])).partners.tolist()
    [1, 0]
    """
    rows, partners = linear_sum_assignment(overlaps, maximize=True)
    return Matching(partners, overlaps[rows, partners], overlaps.max(axis=1))


def match_clusters(overlaps: Array, rows: list[slice], columns: list[slice]) -> Matching:
    """Likewise with the overlaps of clusters; those of one are paired in their order.

    Examples
    --------
    >>> mixed = np.array([[0.8, 0.0, 0.6], [0.6, 0.0, 0.8], [0.0, 1.0, 0.0]])
    >>> alone = [slice(0, 1), slice(1, 2), slice(2, 3)]
    >>> match_clusters(mixed[:, ::-1], [slice(0, 2), slice(2, 3)], alone).partners.tolist()
    [0, 2, 1]
    """
    joined = of_clusters(overlaps, rows, columns)
    partners = match_modes(joined).partners
    for row in rows:
        partners[row] = np.sort(partners[row])
    for column in columns:
        there = (partners >= column.start) & (partners < column.stop)
        partners[there] = np.sort(partners[there])
    paired = joined[np.arange(len(partners)), partners]
    return Matching(partners, paired, joined.max(axis=1))


def recognised(errors: Array, overlaps: Array, rigid: int = RIGID_MODES) -> dict[str, Any]:
    """Number of modes that overlap their partner by `SAME`, and rms and worst of their errors.

    A partner of another shape, which a mode gets that the other solution lacks, has a frequency of
    its own, and says nothing. `errors` and `overlaps` (k,) are those of the partners of elastic
    modes: of the frequencies, relative, and of the shapes.

    Examples
    --------
    >>> recognised(np.array([0.1, -0.3, 9.0]), np.array([0.9, 0.8, 0.2]))
    {'modes': 2, 'rms': 0.22..., 'worst': -0.3, 'worst_mode': 8}
    """
    modes = np.flatnonzero(overlaps >= SAME)
    if len(modes) == 0:
        return {"modes": 0, "rms": None, "worst": None, "worst_mode": None}
    errors = errors[modes]
    worst = int(np.abs(errors).argmax())
    return {
        "modes": len(modes),
        "rms": float(np.sqrt(np.mean(errors**2))),
        "worst": float(errors[worst]),
        "worst_mode": rigid + 1 + int(modes[worst]),
    }


def subspace_angles(modes: Array, truth: Array, M: sp.csr_matrix, groups: list[slice]) -> Array:
    """Largest M-weighted principal angle [rad] of each group of columns.

    The truth's block (n, k) is M-orthonormal; the candidate's, which may come from another mesh, is
    made so group by group; one whose modes are not independent is at a right angle.  The sine is
    taken from the part of the truth outside the candidate's span, which is accurate for small
    angles too.
    """
    angles = np.empty(len(groups))
    for index, group in enumerate(groups):
        inside, exact = modes[:, group], truth[:, group]
        gram = inside.T @ (M @ inside)
        squares = np.linalg.eigvalsh(gram)
        if not squares[0] > DEPENDENT * squares[-1]:  # nor if it is no number
            angles[index] = 0.5 * np.pi
            continue
        factor = np.linalg.cholesky(gram)
        inside = np.linalg.solve(factor, inside.T).T
        outside = exact - inside @ (inside.T @ (M @ exact))
        square = np.linalg.eigvalsh(outside.T @ (M @ outside))[-1]
        angles[index] = np.arcsin(min(1.0, np.sqrt(max(square, 0.0))))
    return angles


@dataclass(frozen=True)
class FrequencyErrors:
    """Relative errors of the frequencies of modes `first`..`last`, matched by index."""

    first: int
    last: int
    rms: float
    mean: float
    """Root mean square and signed mean."""
    worst: float
    worst_mode: int
    """The error of largest magnitude, with its sign, and the mode that has it."""


def frequency_errors(errors: Array, last: int, rigid: int = RIGID_MODES) -> FrequencyErrors:
    """Summary of the relative `errors` (k,) of elastic modes, as far as mode `last`.

    Examples
    --------
    >>> frequency_errors(np.array([0.25, -0.5, 1.0]), last=8)
    FrequencyErrors(first=7, last=8, rms=0.395..., mean=-0.125, worst=-0.5, worst_mode=8)
    """
    part = errors[: last - rigid]
    worst = int(np.argmax(np.abs(part)))
    first = rigid + 1
    return FrequencyErrors(
        first,
        rigid + len(part),
        float(np.sqrt(np.mean(part**2))),
        float(np.mean(part)),
        float(part[worst]),
        first + worst,
    )


def eigenvalue_errors(values: Array, exact: Array) -> dict[str, float]:
    """Median, 90th percentile and maximum of |values - exact| / exact, matched by index.

    Examples
    --------
    >>> eigenvalue_errors(np.array([1.0, 2.5, 4.0]), np.array([1.0, 2.0, 4.0]))["max"]
    0.25
    """
    error = np.abs(values / exact - 1.0)
    return {
        "median": float(np.median(error)),
        "p90": float(np.quantile(error, 0.9)),
        "max": float(error.max()),
    }
