"""Ranks in halves, halves of halves, down to single ranks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import cast

from carillon.processes.mpi import MPI


@dataclass(frozen=True)
class RankGroup:
    """Ranks from `first` to before `stop`, which share the nodes between their halves."""

    first: int
    stop: int

    @property
    def middle(self) -> int:
        """First rank of the second half."""
        return (self.first + self.stop + 1) // 2

    def __contains__(self, rank: int) -> bool:
        return self.first <= rank < self.stop


def groups_of(first: int, stop: int) -> Iterator[RankGroup]:
    """Groups of several ranks, halves before what they are halves of.

    Examples
    --------
    >>> [(group.first, group.stop) for group in groups_of(0, 3)]
    [(0, 2), (0, 3)]
    """
    if stop - first < 2:
        return
    group = RankGroup(first, stop)
    yield from groups_of(first, group.middle)
    yield from groups_of(group.middle, stop)
    yield group


@cache
def _key() -> int:
    """Under which a communicator keeps those of its groups; MPI has begun when it is asked for."""
    return MPI.Comm.Create_keyval()


def communicator(comm: MPI.Comm, group: RankGroup) -> MPI.Comm:
    """The ranks of a group, which call this; made once for each communicator."""
    if comm.Get_attr(_key()) is None:
        comm.Set_attr(_key(), {})
    known = cast(dict[RankGroup, MPI.Comm], comm.Get_attr(_key()))
    if group not in known:
        everyone = comm.Get_group()
        members = everyone.Incl(list(range(group.first, group.stop)))
        known[group] = comm.Create_group(members)
        members.Free()
        everyone.Free()
    return known[group]
