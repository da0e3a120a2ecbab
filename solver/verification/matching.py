"""Which mode of one solution is which of another by shape, and the angles between both."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from carillon.fem.model import RIGID_MODES

Array = NDArray[np.float64]

SAME = 0.5
"""Least overlap of two modes that count as the same."""
DEPENDENT = 1e-10
"""Share of the largest eigenvalue of a Gram matrix below which vectors are dependent."""


@dataclass(frozen=True)
class Matching:
    """The mode of another solution that each mode of the truth is, no two the same.

    Attributes
    ----------
    partners : (k,)
        Indices among the other solution's modes.
    overlaps : (k,)
        With the partner: 1 for the same shape, 0 for an orthogonal one.
    largest : (k,)
        With any mode of the other solution.
    """

    partners: NDArray[np.int64]
    overlaps: Array
    largest: Array


def mode_overlaps(modes: Array, others: Array, weighted: Array) -> Array:
    """Overlaps |v^T M w| (k, l) of modes v (n, k) of unit mass and others w (n, l), made so.

    Parameters
    ----------
    others, weighted
        The other modes on the truth's nodes, and their products with its mass matrix.
    """
    norms = np.sqrt((others * weighted).sum(axis=0))
    return np.asarray(np.abs(modes.T @ (weighted / norms)))


def of_clusters(overlaps: Array, rows: list[slice], columns: list[slice]) -> Array:
    """Overlaps (k, l) of the spaces that modes belong to, from those of single modes.

    Modes of a cluster may be mixed, by which they resemble no single mode of the other solution.
    Each has the root mean square of the cosines between both clusters' spaces instead.

    Parameters
    ----------
    rows, columns
        Clusters of the truth and of the other solution, see `solver.subspace.spectrum.clusters`.

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


def recognised(errors: Array, overlaps: Array) -> dict[str, Any]:
    """Number of modes that overlap their partner by `SAME`, and rms and worst of their errors.

    A partner of another shape, which a mode gets that the other solution lacks, has a frequency of
    its own, and says nothing.

    Parameters
    ----------
    errors, overlaps
        (k,) relative errors of the partners' frequencies, and overlaps with them, of modes 7, 8,...

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
        "worst_mode": RIGID_MODES + 1 + int(modes[worst]),
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
