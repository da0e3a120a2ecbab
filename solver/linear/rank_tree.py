"""Factorisation of K - shift M by all ranks, up the tree of their halves.

Every rank eliminates the inside of its rows by itself (`solver.linear.multifrontal`).  What is left
of the nodes that separate the ranks is merged pairwise: the ranks of two halves share the front of
the nodes between them (`solver.linear.shared_front`, `shared_factor`).  A solve goes up and down
likewise.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from carillon.arrays import Array, Index
from carillon.errors import ConvergenceError, UserError
from carillon.fem.block import degrees_of_freedom
from carillon.processes.memory import available_memory, give_back_freed_memory
from carillon.processes.mpi import MPI
from solver.distribution.collective import on_every_rank, sum_over_machine
from solver.distribution.rank_groups import communicator
from solver.linear.elimination import eliminate_fronts
from solver.linear.multifrontal import Factor, require_memory
from solver.linear.plan import Plan
from solver.linear.separators import Separators
from solver.linear.shared_factor import SharedFactor
from solver.linear.shared_front import Child, SharedFront, Strips, bounds_of, owners

if TYPE_CHECKING:
    from solver.assembly.system import Layout, System


class RankTree:
    """Order of elimination, separating nodes and shared fronts of a mesh, for any material.

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
            self.kept = self._start = np.empty(0, dtype=np.int64)
            self.plan = Plan(lattice, pattern.indptr, columns, steps=steps)
            return
        separators = Separators.of_layout(layout)
        places = separators.places(np.arange(pattern.start, pattern.stop), pattern.ghosts)
        self.kept = _kept_nodes(layout, separators, places)
        ghosts = np.full(len(pattern.ghosts), pattern.indptr[-1])
        inside = np.flatnonzero(places[: self.own] < 0)
        indptr = np.concatenate([pattern.indptr, ghosts])
        self.plan = Plan(lattice, indptr, columns, steps=steps, inside=inside, kept=self.kept)
        # A packed matrix is that of a front on one rank, none of whose rows is its own.
        self._start = Strips(bounds_of(0, 3 * len(self.kept)), 0, 1).start
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

    def operations(self) -> tuple[float, float]:
        """Sums and products of a factorisation by all ranks, and of a solve; collective."""
        factor, solve = self.plan.operations, self.plan.operations_of_solve
        for front in self.fronts:
            # Each rank has its share of a front that is swept out: all rows times all pairs.
            rows = front.own + front.beyond
            factor += front.own * float(rows) ** 2 / front.comm.size
            solve += 2.0 * front.own * (front.own + 2.0 * front.beyond) / front.comm.size
        total = self.comm.allreduce(np.array([factor, solve]))
        return float(total[0]), float(total[1])

    def bytes_of(self, dtype: Any) -> int:
        """Memory of a factorisation on this rank, whose own rows are eliminated in `dtype`."""
        spared = self.plan.bytes * (8 - np.dtype(dtype).itemsize) // 8
        return self.bytes - spared

    def fits(self, share: float, dtype: Any = np.float64) -> bool:
        """Whether a factorisation takes at most that share of every machine's free memory.

        Collective.
        """
        available, needed = available_memory(), sum_over_machine(self.comm, self.bytes_of(dtype))
        fits = available is None or needed < share * available
        return bool(self.comm.allreduce(fits, MPI.LAND))

    @property
    def bytes_of_count(self) -> int:
        """Memory that `count_below` takes on this rank."""
        return self.bytes - self.plan.bytes + self.plan.bytes_of_updates

    def require_count(self, beside: int) -> None:
        """Raise UserError on every rank if `count_below` will not fit into the memory; collective.

        This rank will hold so many more bytes `beside` it than now.
        """
        needed = sum_over_machine(self.comm, self.bytes_of_count + beside)
        self._make_room(needed)

        def check() -> None:
            free = available_memory()
            if free is not None and needed > free:
                raise UserError(
                    f"the count of eigenvalues takes about {needed / 1e9:,.1f} GB with the modes, "
                    f"{free / 1e9:,.1f} GB are free; leave out --check-inertia, or use more ranks "
                    "on more machines"
                )

        on_every_rank(self.comm, check)

    def _make_room(self, needed: int) -> None:
        """Give back freed memory on every rank where a machine has less than it needs; collective.

        Only then, since memory that is given back takes time to come by again.
        """
        free = available_memory()
        if self.comm.allreduce(free is not None and needed > free, MPI.LOR):
            give_back_freed_memory()
            self.comm.Barrier()

    def _require_memory(self, own: int) -> None:
        """Refuse on every rank what takes more memory than one of the machines has.

        Each rank passes what it needs of its machine's.
        """
        needed = sum_over_machine(self.comm, own)
        self._make_room(needed)
        on_every_rank(self.comm, lambda: require_memory(self._unknowns, needed))

    def inverse(
        self, system: System, shift: float, dtype: Any = np.float64
    ) -> TreeInverse | Factor:
        """(K - shift M)^-1; collective. Raises ConvergenceError on every rank if it fails.

        Each rank eliminates the inside of its rows in the precision `dtype`.
        """
        plan, rows = self.plan, system.rows
        self._require_memory(self.bytes_of(dtype))
        factor = on_every_rank(
            self.comm, lambda: Factor(plan, rows.stiffness, rows.mass, shift, rows.threads, dtype)
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
        self._require_memory(self.bytes_of_count)
        negative, rest = on_every_rank(
            self.comm, lambda: eliminate_fronts(plan, *matrices, value, rows.threads, None)
        )
        return self._merged(negative, rest, rows.threads)[0]

    def _merged(self, negative: int, rest: Array, threads: int) -> tuple[int, list[SharedFactor]]:
        """Merge up the tree what is left of the separating nodes.

        Returns how many pivots of all ranks are negative, and this rank's part of the fronts.
        """
        shared = []
        start, failed = self._start, False
        for front in self.fronts:
            data = front.assembled(rest, start)
            factor = SharedFactor(front, data, threads)
            shared.append(factor)
            negative += factor.negative
            failed |= factor.failed
            rest, start = data, front.start_beyond
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
        self._own_kept = degrees_of_freedom(mine), degrees_of_freedom(tree.kept[mine])

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


def _unknowns(nodes: Index, some: Index) -> Index:
    """Places of the unknowns of some ascending nodes among those of `nodes`."""
    return degrees_of_freedom(np.searchsorted(nodes, some))
