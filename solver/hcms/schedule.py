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
PRODUCT_COST = 60.0
"""Operations of a merge's products for each of n^2 reduced unknowns and (nodes)^(2/3), about."""
SHARED_PRODUCTS = 1e9
"""Operations of a merge's products for each rank that helps with them."""
SHARED_SIZE = 400
"""Order of an eigenproblem for each row of ranks that share it: messages take longer below."""


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
    teams, crews = [], []
    for step, (start, stop) in zip(tree.merges, tree.ranges()[tree.parts :], strict=True):
        size = modes[step.left] + modes[step.right]
        cost = eigen_flops(size, True)
        ready = max(done[step.left], done[step.right])
        here, there = holder[step.left], holder[step.right]
        team: tuple[int, ...]
        helpers: list[int] = []
        if here == there:
            end = np.maximum(free, ready) + (1.0 + MOVED_COST) * cost
            end[here] -= MOVED_COST * cost
            # Of equals, the one that has the groups; it is free once they are sent.
            there = here if end[here] <= end.min() else int(np.argmin(end))
            team = (there,)
        else:
            if free[there] < free[here]:
                here, there = there, here
            inside = np.flatnonzero((first >= start) & (first < stop))
            others = [int(rank) for rank in inside if rank not in (here, there)]
            most = max(1, int((size / SHARED_SIZE) ** 2)) if available() else 1
            team = (here, there, *others)[: grid_side(min(2 + len(others), most)) ** 2]
            products = PRODUCT_COST * size**2 * nodes[step.group] ** (2.0 / 3.0)
            helpers = others[: int(products / SHARED_PRODUCTS)]
        finish = max(ready, *(free[rank] for rank in team)) + cost / len(team)
        free[[*team, *helpers, there]] = finish
        holder.append(team[0])
        done.append(finish)
        teams.append(team)
        crews.append((tuple(helpers[::2]), tuple(helpers[1::2])))
    return Schedule(tuple(holder), tuple(teams), tuple(crews))
