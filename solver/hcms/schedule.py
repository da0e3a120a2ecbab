"""Which ranks make which merge, so that merges at the same level run at the same time.

A merge need not happen where its groups' subdomains are.  Merges are dealt in the order of the
tree: one of two groups of different ranks is made on either of them, helped by the other; one of
two groups of the same rank where it would be done first, by the eigenproblems that every rank has
been given until then.  Large eigenproblems are shared by the ranks whose first subdomain is in the
group, of which no two merges at the same level have one in common.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carillon.fem.model import RIGID_MODES
from solver.distribution.tree import Merge, MergeTree
from solver.hcms.counts import eigen_flops
from solver.hcms.scalapack import available, grid_side

MOVED_COST = 0.3
"""Addition to the cost of a merge if both its groups have to be sent."""
MESSAGE_COST = 3e7
"""Operations in the time of a message that a rank waits for: three ways over a link of 1 ms."""
ACROSS_COST = 1.5
"""Operations of the stiffness across a merge for each of n^2 and (nodes)^(2/3), about."""
PRODUCT_COST = 60.0
"""Operations of a merge's products for each of n^2 reduced unknowns and (nodes)^(2/3), about."""
SHARED_PRODUCTS = 4e9
"""Operations of a merge's products for each rank that helps with them."""
SHARED_SIZE = 1600
"""Order of an eigenproblem for each row of ranks that share it.

ScaLAPACK waits for twelve messages a column: on four ranks and links of 1 ms for 10 s, where one
rank takes 0.1 s, at an order of 800; at 3,200 it gains where a message takes less than 0.1 ms.
"""


def modes_to_keep(fraction: float, keep: int) -> int:
    """Modes that a group with `fraction` of the unknowns keeps when the whole keeps `keep`.

    Modes below a common frequency scale with the volume; those that carry the interface with its
    surface.  The square root lies between and grows by 1.4 at each merge.  The rigid motions are
    always among them.
    """
    return max(RIGID_MODES, int(np.ceil(keep * np.sqrt(fraction))))


def planned_modes(tree: MergeTree, nodes: Sequence[float], keep: int) -> list[int]:
    """Modes that every group of so many `nodes` is to keep."""
    modes: list[int] = []
    for group, size in enumerate(nodes):
        available = int(3 * size)
        if group >= tree.parts:
            step = tree.merges[group - tree.parts]
            available = modes[step.left] + modes[step.right]
        modes.append(min(modes_to_keep(size / nodes[-1], keep), available))
    return modes


@dataclass(frozen=True)
class Schedule:
    """Ranks of every group."""

    holder: tuple[int, ...]
    """(groups,) the rank that makes each group, or owns it if it is a subdomain."""
    teams: tuple[tuple[int, ...], ...]
    """(merges,) ranks that share each merge's eigenproblem; the holder is the first."""
    crews: tuple[tuple[tuple[int, ...], tuple[int, ...]], ...]
    """(merges,) ranks that help the holder with its products, and those that help the rank of the
    other group with its own."""
    exchanges: tuple[bool, ...]
    """(merges,) whether the rank of the other group makes the stiffness across, for which the two
    send each other more."""

    def ranks_of(self, number: int, step: Merge) -> set[int]:
        """All ranks that have a part in merge `step`, of this number."""
        holders = self.holder[step.left], self.holder[step.right]
        return {*holders, *self.teams[number], *self.crews[number][0], *self.crews[number][1]}


def schedule(
    tree: MergeTree, owner: NDArray[np.integer], nodes: Sequence[float], keep: int
) -> Schedule:
    """Deal the merges to the ranks; the same on every rank.

    Parameters
    ----------
    owner
        (parts,) rank of each subdomain; contiguous.
    nodes
        (groups,) nodes of each group.
    keep
        Modes kept at the root.
    """
    modes = planned_modes(tree, nodes, keep)
    free = np.zeros(int(owner[-1]) + 1)
    first = np.searchsorted(owner, np.arange(len(free)))
    holder = owner.tolist()
    done = [0.0] * tree.parts
    teams, crews, exchanges = [], [], []
    sizes = [modes[step.left] + modes[step.right] for step in tree.merges]
    levels, single, later = tree.levels(), *_single_ranks(tree, owner)
    # Of merges that are still to be dealt, by level, those of each rank's own subdomains.
    own = np.zeros((levels[-1] + 1, len(free)))
    for step, size in zip(tree.merges, sizes, strict=True):
        if step.group in single:
            own[levels[step.group], single[step.group]] += eigen_flops(size, True)
    ranges = tree.ranges()[tree.parts :]
    for step, size, (start, stop) in zip(tree.merges, sizes, ranges, strict=True):
        cost = eigen_flops(size, True)
        if step.group in single:
            own[levels[step.group], single[step.group]] -= cost
        face = size**2 * nodes[step.group] ** (2.0 / 3.0)
        ready = max(done[step.left], done[step.right])
        here, there = holder[step.left], holder[step.right]
        team: tuple[int, ...]
        helpers: list[int] = []
        if here == there:
            # What is sent away comes back.
            moved = MOVED_COST * cost + 2.0 * MESSAGE_COST
            end = np.maximum(free + own[levels[step.group]], ready) + cost + moved
            end[here] = max(free[here], ready) + cost
            # Of equals, the one that has the groups; it is free once they are sent.
            there = here if end[here] <= end.min() else int(np.argmin(end))
            team = (there,)
        else:
            if later.get(step.group) == there:
                here, there = there, here
            # From there the group is sent on, and what comes of it back.
            onward = 2.0 * MESSAGE_COST if later.get(step.group) == here else 0.0
            if free[there] + onward < free[here]:
                here, there = there, here
            inside = np.flatnonzero((first >= start) & (first < stop))
            others = [int(rank) for rank in inside if rank not in (here, there)]
            most = max(1, int((size / SHARED_SIZE) ** 2)) if available() else 1
            team = (here, there, *others)[: grid_side(min(2 + len(others), most)) ** 2]
            helpers = others[: int(PRODUCT_COST * face / SHARED_PRODUCTS)]
        finish = max(ready, *(free[rank] for rank in team)) + cost / len(team)
        free[[*team, *helpers, there]] = finish
        holder.append(team[0])
        done.append(finish)
        teams.append(team)
        crews.append((tuple(helpers[::2]), tuple(helpers[1::2])))
        exchanges.append(ACROSS_COST * face > MESSAGE_COST)
    return Schedule(tuple(holder), tuple(teams), tuple(crews), tuple(exchanges))


def _single_ranks(
    tree: MergeTree, owner: NDArray[np.integer]
) -> tuple[dict[int, int], dict[int, int]]:
    """The rank of all subdomains of a group, and of all that it is merged with, if it is one."""
    ranks = [(int(owner[start]), int(owner[stop - 1])) for start, stop in tree.ranges()]
    single = {group: first for group, (first, last) in enumerate(ranks) if first == last}
    pairs = [(step.left, step.right) for step in tree.merges]
    partners = dict([*pairs, *((right, left) for left, right in pairs)])
    later = {group: single[other] for group, other in partners.items() if other in single}
    return single, later
