"""Hierarchical component mode synthesis over MPI ranks (section 7.2).

Upward, every merge happens on one rank, its holder, see `solver.hcms.schedule`.  Where the groups
are on two ranks, one sends its group's eigenvalues, boundary cells, the rows of its modes there and
its part of the reduced pencil in one message; large pencils are solved by several ranks.  Downward,
the coefficients of the final modes travel back along the tree in as many, so that the full basis is
formed once, from the small local bases, and stays distributed by rows.  Ranks wait for the merges
that theirs are made of and for no others.
"""

from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array
from carillon.fem.block import degrees_of_freedom
from carillon.processes.mpi import MPI
from carillon.processes.threads import in_parallel
from solver.distribution.collective import receive_arrays, send_arrays
from solver.distribution.local_mesh import LocalMesh
from solver.distribution.tree import Merge
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
        values, weights = climb.push_down()
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

    def push_down(self) -> tuple[Array, dict[int, Array]]:
        """Eigenvalues of the whole, and what its modes are in the local bases of this rank.

        Coefficients (k, modes) are by number of the subdomain; none if the whole is one. A rank
        gets eigenvalues and coefficients in one message.
        """
        tally, holder = self.counts.down, self.holder
        weights: dict[int, Array] = {}
        values, sent = np.empty(0), []
        if self.comm.rank == holder[-1]:
            values = self.groups.pop(len(self.ranges) - 1).values
        for step in reversed(self.tree.merges):
            here = holder[step.group]
            # Those of one other rank at most: it is waiting for them.
            away = [child for child in (step.left, step.right) if holder[child] != here]
            if self.comm.rank == here:
                blocks = self._coefficients(step, weights.pop(step.group, None))
                if away:
                    arrays = [values, *(blocks.pop(child) for child in away)]
                    messages = send_arrays(self.comm, arrays, holder[away[0]], _DOWN)
                    sent.append(tally.sent(messages))
                weights |= blocks
            elif away and self.comm.rank == holder[away[0]]:
                with tally.idle():
                    values, *received = receive_arrays(self.comm, here, _DOWN)
                weights |= dict(zip(away, received, strict=True))
        with tally.idle():
            for messages in sent:
                messages.wait()
        return values, weights

    def _coefficients(self, step: Merge, above: Array | None) -> dict[int, Array]:
        """Coefficients of the final modes in those of each child, by its number.

        `above` (k, modes) are the coefficients in the group's own modes; None if it is the whole.
        """
        sides = dict(zip((step.left, step.right), self.ascent.coefficients.pop(step.group)))
        if above is None:
            return sides
        for side in sides.values():
            self.counts.down.flops += product_flops(len(side), len(above), above.shape[1])
        return {child: side @ above for child, side in sides.items()}

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
