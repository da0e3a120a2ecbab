"""Hierarchical component mode synthesis over MPI ranks (section 7.2).

Upward, every merge happens on one rank, its holder, see `solver.hcms.schedule`.  Where the groups
are on two ranks, one sends its group's eigenvalues, boundary cells and the rows of its modes there,
gets those of the other's modes that it needs, and forms its part of the reduced pencil; large
pencils are solved by several ranks.  Downward, the coefficients of the final modes travel back
along the tree, so that the full basis is formed once, from the small local bases, and stays
distributed by rows.
"""

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from carillon.arrays import Array
from carillon.fem.block import degrees_of_freedom
from carillon.processes.threads import in_parallel
from solver.distribution.collective import receive_arrays, send_arrays
from solver.distribution.local_mesh import LocalMesh
from solver.hcms.condense import DEFAULT_INTERFACE
from solver.hcms.counts import Counts, krylov_flops, product_flops
from solver.hcms.kept_groups import KeptGroups
from solver.hcms.local import Subdomain
from solver.hcms.lowest import FEWER_STEPS, STEPS
from solver.hcms.merge import Group, boundary_of
from solver.hcms.merge_tree import Ascent
from solver.hcms.schedule import modes_to_keep, schedule

FEW_SUBDOMAINS = 8
"""Largest number of subdomains at which the accuracy of their modes matters."""
_DOWN = 12


@dataclass
class Synthesis:
    """Approximate eigenpairs."""

    values: Array
    """(k,) Ritz values [rad^2/s^2], ascending, on every rank."""
    vectors: Array
    """(local unknowns, k) this rank's rows, row-major."""
    counts: Counts


def local_steps(parts: int) -> int:
    """Steps of the local eigensolver: with many subdomains the interfaces err more than it does."""
    return STEPS if parts <= FEW_SUBDOMAINS else FEWER_STEPS


def make_subdomains(local_mesh: LocalMesh, treatment: str, comm: MPI.Comm) -> dict[int, Subdomain]:
    """Geometry of this rank's subdomains, by number; `treatment` is that of the interfaces."""
    lattice = local_mesh.lattice()
    ranges = local_mesh.decomposition.row_ranges()
    subdomains = {}
    for part, cells in local_mesh.cells_by_subdomain(
        local_mesh.decomposition.subdomains_of(comm.rank)
    ).items():
        start, stop = ranges[part]
        own = lattice[start - local_mesh.start : stop - local_mesh.start]
        subdomains[part] = Subdomain(local_mesh.cells.take(cells), start, stop, own, treatment)
    return subdomains


def synthesize(
    local_mesh: LocalMesh,
    keep: int = 512,
    treatment: str = DEFAULT_INTERFACE,
    comm: MPI.Comm = MPI.COMM_WORLD,
    subdomains: dict[int, Subdomain] | None = None,
    threads: int = 1,
    cutoff: float | None = None,
    kept: KeptGroups | None = None,
) -> Synthesis:
    """Approximate the `keep` lowest modes by merging subdomains pairwise up the tree.

    Parameters
    ----------
    keep
        Modes kept at the root; groups below keep `modes_to_keep`.
    subdomains
        Their geometry, if `make_subdomains` was called before with the same treatment.
    cutoff
        Eigenvalue [rad^2/s^2] up to which groups below the root keep their modes, instead of a
        number of them.
    kept
        Groups of the synthesis before, of the same mesh with the same options: those whose
        material is the same are not made again. On return those of this one.

    Notes
    -----
    With any treatment the stiffness at the root is the whole K, so this is a Rayleigh-Ritz
    method there and the values bound the exact eigenvalues from above.
    """
    if subdomains is None:
        subdomains = make_subdomains(local_mesh, treatment, comm)
    try:
        climb = _Climb(local_mesh, keep, treatment, comm, cutoff, kept)
        with climb.counts.local.running():
            climb.solve_subdomains(subdomains, threads)
        climb.ascent.merge_groups(climb.counts)
    except BaseException:
        if kept is not None:
            kept.forget()
        raise
    with climb.counts.down.running():
        values = climb.root_values()
        weights = climb.push_down()
    with climb.counts.basis.running():
        vectors = climb.form_basis(weights)
    return Synthesis(values, vectors, climb.counts)


class _Climb:
    def __init__(
        self,
        local_mesh: LocalMesh,
        keep: int,
        treatment: str,
        comm: MPI.Comm,
        cutoff: float | None,
        kept: KeptGroups | None,
    ) -> None:
        self.local_mesh = local_mesh
        self.keep = keep
        self.cutoff = cutoff
        self.comm = comm
        self.tree = local_mesh.decomposition.tree
        self.ranges = local_mesh.decomposition.row_ranges()
        nodes = [stop - start for start, stop in self.ranges]
        owner = local_mesh.decomposition.owner
        plan = schedule(self.tree, owner, nodes, keep)
        self.holder = plan.holder
        self.counts = Counts(self.tree.levels()[-1])
        self.groups: dict[int, Group] = {}
        self.bases: dict[int, Array] = {}
        own = local_mesh.decomposition.subdomains_of(comm.rank)
        self.cells = {
            part: local_mesh.cells.take(cells)
            for part, cells in local_mesh.cells_by_subdomain(own).items()
        }
        self.kept, unchanged = kept, frozenset[int]()
        if kept is not None:
            elements = {part: cells.elements for part, cells in self.cells.items()}
            unchanged = kept.unchanged(elements, self.tree, comm)
        self.unchanged = unchanged
        self.ascent = Ascent(
            local_mesh, plan, self.groups, keep, cutoff, treatment, comm, kept, unchanged
        )

    def solve_subdomains(self, subdomains: dict[int, Subdomain], threads: int) -> None:
        """Lowest modes of every subdomain of this rank."""
        steps = local_steps(self.tree.parts)

        def solve(part: int) -> tuple[Array, Array]:
            elements = self.cells[part].elements
            return subdomains[part].modes(elements, self._count(part), self._cutoff(part), steps)

        # The largest first, so that no thread is left with one at the end.
        changed = [part for part in subdomains if part not in self.unchanged]
        order = sorted(changed, key=lambda part: self.ranges[part][0] - self.ranges[part][1])
        modes = dict(zip(order, in_parallel(solve, [(part,) for part in order], threads)))
        kept = self.kept
        for part in sorted(subdomains):
            if part in self.unchanged and kept is not None:
                self.bases[part], self.groups[part] = kept.bases[part], kept.groups[part]
                continue
            start, stop = self.ranges[part]
            values, basis = modes[part]
            self.counts.local.flops += krylov_flops(3 * (stop - start), len(values), steps)
            boundary, crossing = boundary_of(self.cells[part], start, stop)
            rows = np.ascontiguousarray(basis[degrees_of_freedom(boundary - start)])
            self.bases[part] = basis
            self.groups[part] = Group(start, stop, values, boundary, rows, crossing)
            if kept is not None:
                kept.bases[part], kept.groups[part] = basis, self.groups[part]

    def _count(self, group: int) -> int:
        start, stop = self.ranges[group]
        return modes_to_keep((stop - start) / self.ranges[-1][1], self.keep)

    def _cutoff(self, group: int) -> float | None:
        """Eigenvalue up to which a group keeps its modes; the whole keeps a number."""
        return self.cutoff if group < len(self.ranges) - 1 else None

    def root_values(self) -> Array:
        """Eigenvalues of the whole, on every rank."""
        comm, root, leader = self.comm, len(self.ranges) - 1, self.holder[-1]
        count = np.zeros(1, dtype=np.int64)
        values = np.empty(0)
        if comm.rank == leader:
            values = self.groups.pop(root).values
            count[0] = len(values)
        with self.counts.down.idle():
            comm.Bcast(count, root=leader)
            if comm.rank != leader:
                values = np.empty(count[0])
            comm.Bcast(values, root=leader)
        if comm.rank == leader:
            self.counts.down.broadcast(count, comm.size)
            self.counts.down.broadcast(values, comm.size)
        return values

    def push_down(self) -> dict[int, Array]:
        """Coefficients of the final modes in every local basis of this rank; none if undivided."""
        tally = self.counts.down
        weights: dict[int, Array] = {}
        sent = []
        for step in reversed(self.tree.merges):
            here = self.holder[step.group]
            # The right side first: more often another rank is waiting for it.
            if self.comm.rank == here:
                above = weights.pop(step.group, None)
                sides = self.ascent.coefficients.pop(step.group)
                for child, side in zip((step.right, step.left), reversed(sides)):
                    block = side if above is None else side @ above
                    if above is not None:
                        tally.flops += product_flops(len(side), len(above), above.shape[1])
                    if self.holder[child] == here:
                        weights[child] = block
                    else:
                        messages = send_arrays(self.comm, [block], self.holder[child], _DOWN)
                        sent.append(tally.sent(messages))
            else:
                for child in (step.right, step.left):
                    if self.comm.rank == self.holder[child]:
                        with tally.idle():
                            (weights[child],) = receive_arrays(self.comm, here, _DOWN)
        with tally.idle():
            for messages in sent:
                messages.wait()
        return weights

    def form_basis(self, weights: dict[int, Array]) -> Array:
        """This rank's rows of the final modes; frees the local bases."""
        start, stop = self.local_mesh.start, self.local_mesh.stop
        if not weights:
            return np.ascontiguousarray(self.bases.pop(0))
        count = next(iter(weights.values())).shape[1]
        vectors = np.empty((3 * (stop - start), count))
        for part, weight in weights.items():
            basis = self.bases.pop(part)
            first, last = self.ranges[part]
            rows = slice(3 * (first - start), 3 * (last - start))
            np.matmul(basis, weight, out=vectors[rows])
            self.counts.basis.flops += product_flops(len(basis), len(weight), count)
        return vectors
