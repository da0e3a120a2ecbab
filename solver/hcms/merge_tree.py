"""The way up the merge tree: every merge by the ranks that the schedule has for it."""

from collections.abc import Collection
from typing import NamedTuple

from carillon.arrays import Array
from carillon.processes.mpi import MPI
from solver.distribution.collective import AnyArray, Sent, receive_arrays, send_arrays
from solver.distribution.local_mesh import Cells, LocalMesh
from solver.distribution.tree import Merge
from solver.hcms.counts import Counts, Tally
from solver.hcms.distributed_products import Crew, help_with_products
from solver.hcms.kept_groups import KeptGroups
from solver.hcms.merge import (
    Group,
    Interface,
    Reduced,
    all_pairs,
    group_from_arrays,
    interface,
    join,
    number_kept,
    project,
    reduced_pencil,
)
from solver.hcms.scalapack import shared_pairs
from solver.hcms.schedule import Schedule, modes_to_keep

_UP = 11


class _Whole(NamedTuple):
    left: Group
    right: Group
    pencil: Reduced


class Ascent:
    """One rank's part in all merges.

    Parameters
    ----------
    groups
        The subdomains of this rank, by number; merged ones are taken out, and the others' put in.
    kept
        Groups of the synthesis before; those of this one are put there.
    unchanged
        Numbers of the groups that are taken from there.

    Attributes
    ----------
    coefficients
        Q of the merges that this rank holds, split between left and right.
    """

    def __init__(
        self,
        local_mesh: LocalMesh,
        plan: Schedule,
        groups: dict[int, Group],
        keep: int,
        cutoff: float | None,
        treatment: str,
        comm: MPI.Comm,
        kept: KeptGroups | None = None,
        unchanged: Collection[int] = (),
    ) -> None:
        self.local_mesh = local_mesh
        self.tree = local_mesh.decomposition.tree
        self.ranges = local_mesh.decomposition.row_ranges()
        self.plan = plan
        self.groups = groups
        self.keep = keep
        self.cutoff = cutoff
        self.treatment = treatment
        self.comm = comm
        self.kept = kept
        self.unchanged = unchanged
        self.coefficients: dict[int, tuple[Array, Array]] = {}
        self._sent: list[Sent] = []

    def merge_groups(self, counts: Counts) -> None:
        """Make the merges that this rank has a part in, in the order of the tree.

        All ranks keep this order, so whoever waits does so for an earlier merge, or for this one.
        """
        levels = self.tree.levels()
        for number, step in enumerate(self.tree.merges):
            tally = counts.merges[levels[step.group] - 1]
            if step.group in self.unchanged:
                self._take_kept(step.group)
            elif self.comm.rank in self.plan.ranks_of(number, step):
                with tally.running():
                    self._merge(step, number, tally)
        with counts.down.running(), counts.down.idle():
            for messages in self._sent:
                messages.wait()

    def _take_kept(self, group: int) -> None:
        """Put a merged group of the synthesis before among the groups, if this rank holds it."""
        kept = self.kept
        if kept is not None and self.plan.holder[group] == self.comm.rank:
            self.groups[group] = kept.groups[group]
            self.coefficients[group] = kept.coefficients[group]

    def _merge(self, step: Merge, number: int, tally: Tally) -> None:
        holder, crews = self.plan.holder, self.plan.crews[number]
        here = holder[step.group]
        sides = holder[step.left], holder[step.right]
        helped = [crew for crew in crews if self.comm.rank in crew]
        whole = None
        if helped:
            there = sides[0] if sides[1] == here else sides[1]
            help_with_products(self.comm, here if helped[0] is crews[0] else there, tally)
        elif sides[0] == sides[1]:
            whole = self._reduce_alone(step, Crew(self.comm, (), tally))
        elif self.comm.rank in sides:
            crew = Crew(self.comm, crews[0 if self.comm.rank == here else 1], tally)
            whole = self._reduce_together(step, self.plan.exchanges[number], crew)
            crew.dismiss()
        pairs = self._pairs(self.plan.teams[number], whole, tally)
        if helped:
            help_with_products(self.comm, here, tally)
        elif whole is not None and pairs is not None:
            crew = Crew(self.comm, (*crews[0], *crews[1]), tally)
            self._join(step, whole, pairs, crew)
            crew.dismiss()

    def _reduce_alone(self, step: Merge, crew: Crew) -> _Whole | None:
        """Pencil of two groups of the same rank, on the holder of what becomes of them."""
        there, here = self.plan.holder[step.left], self.plan.holder[step.group]
        children = step.left, step.right
        if self.comm.rank == there:
            groups = [self.groups.pop(child) for child in children]
            if there != here:
                arrays = [array for group in groups for array in group.arrays()]
                self._send(arrays, here, crew.tally)
        if self.comm.rank != here:
            return None
        if there != here:
            arrays = self._receive(there, crew.tally)
            half = len(arrays) // 2
            groups = [
                self._group(child, each)
                for child, each in zip(children, (arrays[:half], arrays[half:]), strict=True)
            ]
        left, right = groups
        between = self._interface(step, left.cells)
        first, second = left.modes_at(between.left), right.modes_at(between.right)
        *within, coupling = between.blocks(between.stiffness)
        *stiffness, mass = project(
            [
                (first, within[0], first),
                (second, within[1], second),
                (second, coupling, first),
                (second, between.mass_across, first),
            ],
            crew,
        )
        return _Whole(left, right, reduced_pencil(left.values, right.values, stiffness, mass))

    def _reduce_together(self, step: Merge, exchange: bool, crew: Crew) -> _Whole | None:
        """Pencil of two groups of different ranks, on the holder of what becomes of them.

        Either forms the stiffness of its own group, and the other rank sends it with the group.
        With an `exchange` it also forms the stiffness across, for which it gets the holder's modes.
        """
        holder, tally = self.plan.holder, crew.tally
        here = self.comm.rank == holder[step.group]
        ours, theirs = step.left, step.right
        if self.comm.rank != holder[ours]:
            ours, theirs = theirs, ours
        partner, mine = holder[theirs], self.groups.pop(ours)
        if exchange and not here:
            self._send(mine.arrays(), partner, tally)
        between = self._interface(step, mine.cells)
        side = 0 if ours == step.left else 1
        *within, coupling = between.blocks(between.stiffness)
        modes = mine.modes_at((between.left, between.right)[side])
        if exchange and here:
            self._send([modes], partner, tally)
        stiffness = project([(modes, within[side], modes)], crew)
        if not here:
            if exchange:
                modes_of = modes, *self._receive(partner, tally)
                stiffness += project([(modes_of[1 - side], coupling, modes_of[side])], crew)
            self._send(stiffness if exchange else [*stiffness, *mine.arrays()], partner, tally)
            return None
        arrays = self._receive(partner, tally)
        others = [] if exchange else [arrays.pop(0)]
        other = self._group(theirs, arrays)
        left, right = (mine, other) if side == 0 else (other, mine)
        first, second = left.modes_at(between.left), right.modes_at(between.right)
        terms = [(second, between.mass_across, first)]
        if not exchange:
            terms.append((second, coupling, first))
        mass, *across = project(terms, crew)
        if exchange:
            others, across = ([each] for each in self._receive(partner, tally))
        stiffness = [*stiffness, *others] if side == 0 else [*others, *stiffness]
        pencil = reduced_pencil(left.values, right.values, [*stiffness, *across], mass)
        return _Whole(left, right, pencil)

    def _pairs(
        self, team: tuple[int, ...], whole: _Whole | None, tally: Tally
    ) -> tuple[Array, Array] | None:
        """All eigenpairs of the pencil that the first of the team has, there."""
        pencil = None if whole is None else whole.pencil
        if len(team) == 1:
            return None if pencil is None else all_pairs(pencil, tally)
        if self.comm.rank not in team:
            return None
        comm = self.comm.Create_group(self.comm.group.Incl(team))
        pairs = shared_pairs(comm, pencil, tally)
        comm.Free()
        return pairs

    def _join(self, step: Merge, whole: _Whole, pairs: tuple[Array, Array], crew: Crew) -> None:
        start, stop = self.ranges[step.group]
        root = step.group == len(self.ranges) - 1
        keep = modes_to_keep((stop - start) / self.ranges[-1][1], self.keep)
        # The groups below the root keep their modes up to a cutoff, the whole a number.
        count = number_kept(pairs[0], keep, None if root else self.cutoff)
        values, Q = pairs[0][:count], pairs[1][:, :count]
        self.groups[step.group] = join(whole.left, whole.right, values, Q, crew)
        split = len(whole.left.values)
        self.coefficients[step.group] = Q[:split], Q[split:]
        if self.kept is not None:
            self.kept.groups[step.group] = self.groups[step.group]
            self.kept.coefficients[step.group] = self.coefficients[step.group]

    def _interface(self, step: Merge, cells: Cells) -> Interface:
        start, middle = self.ranges[step.left]
        _, stop = self.ranges[step.right]
        return interface(cells, start, middle, stop, self.treatment)

    def _send(self, arrays: list[AnyArray], rank: int, tally: Tally) -> None:
        self._sent.append(tally.sent(send_arrays(self.comm, arrays, rank, _UP)))

    def _receive(self, rank: int, tally: Tally) -> list[AnyArray]:
        with tally.idle():
            return receive_arrays(self.comm, rank, _UP)

    def _group(self, group: int, arrays: list[AnyArray]) -> Group:
        return group_from_arrays(arrays, *self.ranges[group], self.local_mesh.cells)
