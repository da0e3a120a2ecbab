"""Factorisation of K - shift M by all ranks, up the tree of their halves.

Every rank eliminates the inside of its rows by itself (`solver.linear.multifrontal`).  What is left
of the nodes that separate the ranks is merged pairwise: the ranks of two halves share the front of
the nodes between them (`solver.linear.shared_front`, `shared_factor`).  A solve goes up and down
likewise.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from carillon.arrays import Array, Index
from carillon.errors import ConvergenceError
from carillon.processes.memory import available_memory
from solver.distribution.collective import on_every_rank, sum_over_machine
from solver.distribution.rank_groups import communicator
from solver.linear.elimination import eliminate_fronts
from solver.linear.multifrontal import Factor
from solver.linear.plan import STRIP, Plan
from solver.linear.separators import Separators
from solver.linear.shared_factor import SharedFactor
from solver.linear.shared_front import Child, SharedFront, Strips, owners

if TYPE_CHECKING:
    from solver.assembly.system import Layout, System


class RankTree:
    """What the factorisation needs to know of the mesh alone.

    Attributes
    ----------
    plan
        Elimination of this rank's rows, but of those that separate it from others.
    fronts
        Fronts that this rank shares, from that of the smallest group to that of all ranks.
    """

    def __init__(self, layout: Layout) -> None:
        """Find the separating nodes, and order all others; collective."""
        self.comm = comm = layout.comm
        pattern = layout.pattern
        self._unknowns = layout.local_mesh.n_dofs
        self.own = pattern.stop - pattern.start
        steps = layout.local_mesh.cells.elements.steps
        lattice, columns = layout.local_mesh.lattice(), pattern.columns
        self.fronts: list[SharedFront] = []
        if comm.size == 1:
            self.kept = np.empty(0, dtype=np.int64)
            self.plan = Plan(lattice, pattern.indptr, columns, steps=steps)
            return
        separators = Separators.of_layout(layout)
        places = separators.places(np.arange(pattern.start, pattern.stop), pattern.ghosts)
        self.kept = _kept_nodes(layout, separators, places)
        ghosts = np.full(len(pattern.ghosts), pattern.indptr[-1])
        inside = np.flatnonzero(places[: self.own] < 0)
        indptr = np.concatenate([pattern.indptr, ghosts])
        self.plan = Plan(lattice, indptr, columns, steps=steps, inside=inside, kept=self.kept)
        self._share_fronts(separators, places[self.kept])

    def _share_fronts(self, separators: Separators, beyond: Index) -> None:
        """Make the shared fronts, from what this rank leaves of the separating nodes `beyond`."""
        comm, eliminated = self.comm, 0
        for number in separators.path(comm.rank):
            group = separators.groups[number]
            ranks = communicator(comm, group)
            half = group.middle - group.first
            left = [ranks.bcast((eliminated, beyond), root=root) for root in (0, half)]
            own = np.arange(separators.offsets[number], separators.offsets[number + 1])
            nodes = np.unique(np.concatenate([own, *(rest for _, rest in left)]))
            members = range(half), range(half, ranks.size)
            children = [
                Child(each, owners(3 * gone, 3 * len(rest), len(each)), _unknowns(nodes, rest))
                for each, (gone, rest) in zip(members, left, strict=True)
            ]
            self.fronts.append(
                SharedFront(ranks, 3 * len(own), 3 * (len(nodes) - len(own)), children)
            )
            eliminated, beyond = len(own), nodes[len(own) :]

    @property
    def bytes(self) -> int:
        """Memory that a factorisation takes on this rank while it is made."""
        return self.plan.bytes + sum(front.bytes for front in self.fronts)

    def fits(self, share: float) -> bool:
        """Whether a factorisation takes at most that share of every machine's free memory.

        Collective.
        """
        _, shares = self._needs(self.bytes)
        return max(shares) < share

    def _needs(self, own: int) -> tuple[int, list[float]]:
        """Sum over the ranks of the bytes that each needs, and shares of free memory; collective.

        The share is that of the rank's machine, of which all its ranks take.
        """
        available, needed = available_memory(), sum_over_machine(self.comm, own)
        share = 0.0 if available is None else needed / max(available, 1)
        return self.comm.allreduce(own), self.comm.allgather(share)

    def _require_memory(self, own: int) -> None:
        """The system lends memory that it has not got, and kills who uses it."""
        needed, shares = self._needs(own)
        if max(shares) > 1.0:
            raise ConvergenceError(
                f"the sparse factorisation of {self._unknowns:,} unknowns takes about "
                f"{needed / 1e9:.1f} GB, {needed / max(shares) / 1e9:.1f} GB are free; use "
                "--linear-solver amg-cg, or more ranks on more machines"
            )

    def inverse(self, system: System, shift: float) -> TreeInverse | Factor:
        """(K - shift M)^-1; collective. Raises ConvergenceError on every rank if it fails."""
        plan, rows = self.plan, system.rows
        self._require_memory(self.bytes)
        factor = on_every_rank(
            self.comm, lambda: Factor(plan, rows.stiffness, rows.mass, shift, rows.threads)
        )
        if self.comm.size == 1:
            return factor
        negative, shared = self._merged(factor.negative, factor.rest, rows.threads)
        factor.rest = factor.rest[:0]
        return TreeInverse(self, factor, shared, shift, negative)

    def count_below(self, system: System, value: float) -> int:
        """Eigenvalues of K - value M below zero, by inertia; collective.

        Raises ConvergenceError on every rank if the factorisation fails.
        """
        plan, rows = self.plan, system.rows
        matrices = rows.stiffness, rows.mass
        self._require_memory(self.bytes - plan.bytes + plan.bytes_of_updates)
        negative, rest = on_every_rank(
            self.comm, lambda: eliminate_fronts(plan, *matrices, value, rows.threads, None)
        )
        return self._merged(negative, rest, rows.threads)[0]

    def _merged(self, negative: int, rest: Array, threads: int) -> tuple[int, list[SharedFactor]]:
        """Merge up the tree what is left of the separating nodes.

        Returns how many pivots of all ranks are negative, and this rank's part of the fronts.
        """
        shared = []
        start = Strips(_bounds_of_packed(3 * len(self.kept)), 0, 1).start
        failed = False
        for front in self.fronts:
            data = front.assembled(rest, start)
            factor = SharedFactor(front, data, threads)
            shared.append(factor)
            negative += factor.negative
            failed |= factor.failed
            rest, start = front.left(data)
        negative, failures = self.comm.allreduce(np.array([negative, failed]))
        if failures:
            raise ConvergenceError("the shifted matrix is singular to rounding; change the shift")
        return int(negative), shared


class TreeInverse:
    """Action of (K - shift M)^-1 by the factors of all ranks; see `solver.linear.Inverse`."""

    exact = True

    def __init__(
        self,
        tree: RankTree,
        factor: Factor,
        shared: list[SharedFactor],
        shift: float,
        negative: int,
    ) -> None:
        self.shift = shift
        self.negative = negative
        self._tree, self._factor, self._shared = tree, factor, shared
        # This rank's own among the nodes that it keeps, as unknowns of either.
        mine = np.flatnonzero(tree.kept < tree.own)
        self._own_kept = _three(mine), _three(tree.kept[mine])

    def solve(self, block: Array) -> Array:
        """Solutions for a row-major block of right-hand sides (local unknowns, k); collective."""
        fronts, (kept, own) = self._tree.fronts, self._own_kept
        works, rows = self._factor.eliminate(block)
        rows[kept] += block[own]
        begun = []
        for front, shared in zip(fronts, self._shared, strict=True):
            whole = np.zeros((front.own + front.beyond, block.shape[1]))
            whole[front.child.places] = rows
            rows, first_half = shared.eliminate(whole)
            begun.append(first_half)
        for front, shared in zip(reversed(fronts), reversed(self._shared), strict=True):
            rows = shared.substitute(begun.pop(), rows)[front.child.places]
        solution = np.empty_like(block)
        self._factor.substitute(works, rows, solution)
        solution[own] = rows[kept]
        return solution

    def destroy(self) -> None:
        """Nothing but arrays to free."""


def _kept_nodes(layout: Layout, separators: Separators, places: Index) -> Index:
    """Separating nodes that this rank's rows are coupled to, in the order of their elimination.

    Numbers of columns, whose `places` among the separating nodes are given: own ones, and those
    of others that are eliminated after a row of this rank that is coupled to them.
    """
    pattern = layout.pattern
    own = pattern.stop - pattern.start
    row = np.repeat(np.arange(own), np.diff(pattern.indptr))
    later = pattern.columns[places[pattern.columns] > places[row]]
    on_path = np.isin(separators.group_of(places), separators.path(layout.comm.rank))
    needed = places >= 0
    needed[own:] = False
    needed[later] = True
    nodes = np.flatnonzero(needed & on_path)
    return nodes[np.argsort(places[nodes])]


def _bounds_of_packed(rows: int) -> Index:
    """First rows of the strips of a packed matrix, see `solver.linear.plan.packed_size`."""
    return np.array([*range(0, rows, STRIP), rows], dtype=np.int64)


def _three(nodes: Index) -> Index:
    return (3 * nodes[:, None] + np.arange(3)).ravel()


def _unknowns(nodes: Index, some: Index) -> Index:
    """Places of the unknowns of some ascending nodes among those of `nodes`."""
    return _three(np.searchsorted(nodes, some))
