"""Hierarchical component mode synthesis over MPI ranks (section 7.2).

Upward, every merge happens on one rank, the owner of its left group; the right group sends its
eigenvalues and the rows of its modes at nodes that later merges touch, and nothing else.  Downward,
the coefficients of the final modes travel back along the tree, so that the full basis is formed
once, from the small local bases, and stays distributed by rows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from dataset_gen.block import degrees_of_freedom
from solver.decomposition import Decomposition
from solver.hcms.local import local_modes
from solver.hcms.merge import Group, interface, joined_rows, merge
from solver.hcms.tree import Merge
from solver.model import ElasticModel

Array = NDArray[np.float64]

_UP, _DOWN = 11, 12


@dataclass
class Synthesis:
    """Approximate eigenpairs.

    Attributes
    ----------
    values
        (k,) Ritz values [rad^2/s^2], ascending, on every rank.
    vectors
        (local unknowns, k) this rank's rows in the decomposition's order, Fortran-contiguous.
    """

    values: Array
    vectors: Array


def modes_to_keep(share: float, keep: int) -> int:
    """Modes that a group with `share` of the unknowns keeps when the whole keeps `keep`.

    Modes below a common frequency scale with the volume; those that carry the interface with its
    surface.  The square root lies between and grows by 1.4 at each merge.
    """
    return int(np.ceil(keep * np.sqrt(share)))


def synthesize(
    model: ElasticModel,
    decomposition: Decomposition,
    keep: int = 512,
    treatment: str = "free",
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> Synthesis:
    """Approximate the `keep` lowest modes by merging subdomains pairwise up the tree.

    Parameters
    ----------
    model
        The solid.
    decomposition
        Subdomains, merge tree and owners, the same on all ranks.
    keep
        Modes kept at the root; groups below keep `modes_to_keep`.
    treatment
        Interface treatment, `free` or `fixed`.

    Notes
    -----
    With `free` interfaces the stiffness at the root is the whole K, so this is a Rayleigh-Ritz
    method there and the values bound the exact eigenvalues from above.
    """
    tree, owner = decomposition.tree, decomposition.owner
    ranges = tree.ranges()
    leader = list(owner)
    for step in tree.merges:
        leader.append(leader[step.left])
    sizes = decomposition.group_sizes()
    total = sizes[-1]
    rank = comm.rank
    neighbours = _OutsideNeighbours(model, decomposition)

    bases: dict[int, Array] = {}
    groups: dict[int, Group] = {}
    for part in np.flatnonzero(owner == rank):
        nodes = decomposition.nodes_of(part)
        wanted = modes_to_keep(3 * len(nodes) / total, keep)
        values, bases[part] = local_modes(model, nodes, wanted, treatment)
        boundary = neighbours.boundary(part, part + 1)
        rows = degrees_of_freedom(np.searchsorted(nodes, boundary))
        groups[part] = Group(values, boundary, bases[part][rows])

    coefficients: dict[int, Array] = {}
    left_sizes: dict[int, int] = {}
    for step in tree.merges:
        here, there = leader[step.left], leader[step.right]
        if rank == there and here != there:
            comm.send(groups.pop(step.right), dest=here, tag=_UP)
        if rank != here:
            continue
        left = groups.pop(step.left)
        right = groups.pop(step.right) if here == there else comm.recv(source=there, tag=_UP)
        between = interface(
            model, decomposition.sides(ranges[step.left], ranges[step.right]), treatment
        )
        wanted = modes_to_keep(sizes[step.group] / total, keep)
        values, Q = merge(left, right, between, wanted)
        boundary = neighbours.boundary(*ranges[step.group])
        groups[step.group] = Group(values, boundary, joined_rows(left, right, Q, boundary))
        coefficients[step.group] = Q
        left_sizes[step.group] = len(left.values)

    root = 2 * tree.parts - 2
    values = comm.bcast(groups[root].values if rank == leader[root] else None, root=leader[root])
    weights = _push_down(tree.merges, leader, coefficients, left_sizes, comm)
    if tree.parts == 1:
        weights = {0: np.eye(len(values))}
    blocks = [bases[part] @ weights[part] for part in np.flatnonzero(owner == rank)]
    vectors = np.asfortranarray(np.concatenate(blocks))
    return Synthesis(values, vectors)


def _push_down(
    merges: tuple[Merge, ...],
    leader: list[int],
    coefficients: dict[int, Array],
    left_sizes: dict[int, int],
    comm: MPI.Comm,
) -> dict[int, Array]:
    """Coefficients of the final modes in every local basis of this rank."""
    rank = comm.rank
    weights: dict[int, Array] = {}
    for step in reversed(merges):
        here, there = leader[step.left], leader[step.right]
        if rank == here:
            Q = coefficients.pop(step.group)
            split = left_sizes[step.group]
            above = weights.pop(step.group, None)
            for child, part in ((step.left, Q[:split]), (step.right, Q[split:])):
                block = part if above is None else part @ above
                if leader[child] == rank:
                    weights[child] = block
                else:
                    comm.send(np.ascontiguousarray(block), dest=there, tag=_DOWN)
        elif rank == there:
            weights[step.right] = comm.recv(source=here, tag=_DOWN)
    return weights


class _OutsideNeighbours:
    """Finds the nodes of a contiguous range of subdomains that share a cell with the outside."""

    def __init__(self, model: ElasticModel, decomposition: Decomposition) -> None:
        self._cells = model.mesh.cells
        corner = decomposition.node_part[self._cells]
        self._lowest = corner.min(axis=1)
        self._highest = corner.max(axis=1)
        self._corner = corner

    def boundary(self, start: int, stop: int) -> NDArray[np.int64]:
        """Sorted nodes in subdomains [start, stop) with a neighbour outside."""
        crossing = (self._lowest < start) | (self._highest >= stop)
        corner = self._corner[crossing]
        inside = (corner >= start) & (corner < stop)
        return np.unique(self._cells[crossing][inside]).astype(np.int64)
