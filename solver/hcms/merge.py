"""Joining two groups of subdomains by a reduced eigenproblem (Eq. 13-15)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from numpy.typing import NDArray

from dataset_gen.block import degrees_of_freedom
from solver.hcms.condense import restrict_stiffness
from solver.model import ElasticModel
from solver.sparse import assemble_elements

Array = NDArray[np.float64]


@dataclass
class Group:
    """What a merge needs to know of a group of subdomains.

    Attributes
    ----------
    values
        (k,) eigenvalues of the kept modes.
    boundary
        Sorted nodes that share a cell with a node outside the group.
    rows
        (3 * len(boundary), k) rows of the kept modes at these nodes.
    """

    values: Array
    boundary: NDArray[np.int64]
    rows: Array


@dataclass
class Interface:
    """The matrices that a merge adds back, on the nodes of the cells that straddle both groups.

    The stiffness is K(left + right) - K(left) - K(right), each restricted to its own nodes, and the
    mass is the coupling that the two groups' masses leave out.
    """

    nodes: NDArray[np.int64]
    in_left: NDArray[np.bool_]
    stiffness: sp.csr_matrix
    mass: sp.csr_matrix


def interface(model: ElasticModel, group_of: NDArray[np.int8], treatment: str) -> Interface:
    """Interface between left (1) and right (2) nodes; `group_of` (n,) is 0 for nodes in neither."""
    corner_group = group_of[model.mesh.cells]
    straddling = np.flatnonzero((corner_group == 1).any(axis=1) & (corner_group == 2).any(axis=1))
    left, right = corner_group[straddling] == 1, corner_group[straddling] == 2
    element = model.stiffness(straddling)
    stiffness = (
        restrict_stiffness(element, left | right, treatment)
        - restrict_stiffness(element, left, treatment)
        - restrict_stiffness(element, right, treatment)
    )
    across = left[:, :, None] & right[:, None, :]
    mass = model.nodal_mass(straddling) * (across | across.transpose(0, 2, 1))
    cells = model.mesh.cells[straddling]
    nodes = np.unique(cells[left | right]).astype(np.int64)
    position = np.zeros(model.mesh.n_nodes, dtype=np.int64)
    position[nodes] = np.arange(len(nodes))
    K, M = assemble_elements(position[cells], stiffness, mass, len(nodes))
    return Interface(nodes, group_of[nodes] == 1, K, M)


def merge(left: Group, right: Group, between: Interface, keep: int) -> tuple[Array, Array]:
    """Lowest eigenpairs of the joined groups in the space of their kept modes.

    Returns
    -------
    values (k,) and coefficients Q (len(left.values) + len(right.values), k).
    """
    n_left = len(left.values)
    size = n_left + len(right.values)
    rows = np.zeros((3 * len(between.nodes), size))
    in_left = np.repeat(between.in_left, 3)
    rows[in_left, :n_left] = _rows_at(left, between.nodes[between.in_left])
    rows[~in_left, n_left:] = _rows_at(right, between.nodes[~between.in_left])
    K = rows.T @ (between.stiffness @ rows)
    K[np.diag_indices(size)] += np.concatenate([left.values, right.values])
    keep = min(keep, size)
    if between.mass.count_nonzero():
        M = rows.T @ (between.mass @ rows)
        M[np.diag_indices(size)] += 1.0
        values, vectors = la.eigh(_symmetric(K), _symmetric(M), driver="gvd", check_finite=False)
    else:
        values, vectors = la.eigh(_symmetric(K), driver="evd", check_finite=False)
    return values[:keep], vectors[:, :keep]


def joined_rows(left: Group, right: Group, Q: Array, boundary: NDArray[np.int64]) -> Array:
    """Rows of the joined modes at the nodes `boundary`, which each group holds a part of."""
    n_left = len(left.values)
    joined = np.empty((3 * len(boundary), Q.shape[1]))
    is_left = np.isin(boundary, left.boundary)
    joined[np.repeat(is_left, 3)] = _rows_at(left, boundary[is_left]) @ Q[:n_left]
    joined[np.repeat(~is_left, 3)] = _rows_at(right, boundary[~is_left]) @ Q[n_left:]
    return joined


def _rows_at(group: Group, nodes: NDArray[np.int64]) -> Array:
    return group.rows[degrees_of_freedom(np.searchsorted(group.boundary, nodes))]


def _symmetric(matrix: Array) -> Array:
    return np.asarray(0.5 * (matrix + matrix.T))
