"""What the synthesis will do on any number of ranks, counted without doing it.

The same formulas as in `solver.hcms`, applied to the sizes along the merge tree.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.distribution.messages import MOST_ARRAYS, MOST_DIMENSIONS
from solver.hcms.counts import (
    Counts,
    Tally,
    count_shared_eigenproblem,
    eigen_flops,
    krylov_flops,
    product_flops,
    sparse_product_flops,
)
from solver.hcms.distributed_products import row_slices
from solver.hcms.scalapack import places
from solver.hcms.schedule import Schedule, planned_modes, schedule
from solver.hcms.synthesis import local_steps
from studies.scaling.sizes import TreeSizes

HEADER_BYTES = 8 * (MOST_ARRAYS + 1) * (2 + MOST_DIMENSIONS)
"""Bytes of the announcement that goes before the arrays of a message."""
REAL_BYTES = 8
_GROUP_MESSAGES = 7
"""Announcement, eigenvalues, boundary, modes there, three arrays of cells."""


def planned_counts(sizes: TreeSizes, owner: NDArray[np.integer], keep: int) -> list[Counts]:
    """Counts of every rank, without seconds.

    Parameters
    ----------
    sizes
        Along the merge tree.
    owner
        (parts,) rank of each subdomain.
    keep
        Modes kept at the root.
    """
    tree = sizes.tree
    levels = tree.levels()
    ranks = int(owner[-1]) + 1
    counts = [Counts(levels[-1]) for _ in range(ranks)]
    plan = schedule(tree, owner, sizes.nodes.tolist(), keep)
    modes = planned_modes(tree, sizes.nodes.tolist(), keep)
    root, steps = modes[-1], local_steps(tree.parts)
    for part in range(tree.parts):
        rank, unknowns = counts[int(owner[part])], 3 * sizes.nodes[part]
        rank.local.flops += krylov_flops(int(unknowns), modes[part], steps)
        if tree.merges:
            rank.basis.flops += product_flops(int(unknowns), modes[part], root)
    for number, step in enumerate(tree.merges):
        tallies = [each.merges[levels[step.group] - 1] for each in counts]
        _plan_merge(sizes, number, modes, tallies, plan)
        _plan_eigenproblem(modes[step.left] + modes[step.right], tallies, plan.teams[number])
        here = plan.holder[step.group]
        last = step.group == len(levels) - 1
        down = counts[here].down
        for child in (step.left, step.right):
            if not last:
                down.flops += product_flops(modes[child], modes[step.group], root)
            if plan.holder[child] != here:
                _send(down, REAL_BYTES * modes[child] * root)
    top = counts[plan.holder[-1]].down
    top.messages += 2 * (ranks - 1)
    top.bytes += (ranks - 1) * REAL_BYTES * (1 + root)
    return counts


def _plan_merge(
    sizes: TreeSizes, number: int, modes: list[int], tallies: list[Tally], plan: Schedule
) -> None:
    """Add a merge, without its eigenproblem, to the tallies of its level, one a rank."""
    step = sizes.tree.merges[number]
    left, right, joined = modes[step.left], modes[step.right], modes[step.group]
    rows = {
        step.left: int(3 * sizes.rows_left[number]),
        step.right: int(3 * sizes.rows_right[number]),
    }
    pairs = {step.left: sizes.pairs_left[number], step.right: sizes.pairs_right[number]}
    across = sizes.pairs_across[number]
    holder, crews = plan.holder, plan.crews[number]
    here = holder[step.group]
    mine, other = step.left, step.right
    if holder[mine] != here:
        mine, other = other, mine
    there = here if holder[mine] == holder[other] else holder[other]
    ours, theirs = _Crew(tallies, (here, *crews[0])), _Crew(tallies, (there, *crews[1]))
    for child, crew in ((mine, ours), (other, theirs)):
        crew.project(modes[child], rows[child], modes[child], 9 * pairs[child])
    theirs.project(right, rows[step.right], left, 9 * across)
    ours.project(right, rows[step.right], left, 3 * across)
    everyone = _Crew(tallies, (here, *crews[0], *crews[1]))
    boundary = int(3 * sizes.boundary_left[number])
    everyone.multiply(boundary, left, joined)
    everyone.multiply(int(3 * sizes.boundary[step.group]) - boundary, right, joined)
    for crew in (ours, theirs, everyone):
        crew.dismiss()
    if here != there:
        _send(tallies[here], REAL_BYTES * rows[mine] * modes[mine])
        _send_group(sizes, other, modes[other], tallies[there])
        _send(tallies[there], REAL_BYTES * modes[other] ** 2, REAL_BYTES * left * right)
    elif holder[mine] != here:
        for child in (mine, other):
            _send_group(sizes, child, modes[child], tallies[holder[child]])


class _Crew:
    """Tallies of ranks that share products by rows (`hcms.distributed_products`); one leads."""

    def __init__(self, tallies: list[Tally], ranks: tuple[int, ...]) -> None:
        self.leader, *self.helpers = (tallies[rank] for rank in ranks)

    def multiply(self, rows: int, inner: int, columns: int) -> None:
        """Dense product (rows, inner) (inner, columns), shared by rows."""
        first, *others = self._shares(rows)
        self.leader.flops += product_flops(first, inner, columns)
        for helper, share in zip(self.helpers, others, strict=True):
            helper.flops += product_flops(share, inner, columns)
            given = share * inner, inner * columns
            _send(self.leader, REAL_BYTES, *(REAL_BYTES * size for size in given))
            _send(helper, REAL_BYTES * share * columns)

    def project(self, rows: int, inner: int, columns: int, entries: float) -> None:
        """Projection modes^T matrix others; `inner` is shared."""
        self.leader.flops += sparse_product_flops(int(entries), columns)
        first, *others = self._shares(inner)
        self.leader.flops += product_flops(rows, first, columns)
        for helper, share in zip(self.helpers, others, strict=True):
            helper.flops += product_flops(rows, share, columns)
            given = share * rows, share * columns
            _send(self.leader, REAL_BYTES, *(REAL_BYTES * size for size in given))
            _send(helper, REAL_BYTES * rows * columns)

    def dismiss(self) -> None:
        for _ in self.helpers:
            _send(self.leader)

    def _shares(self, rows: int) -> list[int]:
        return [each.stop - each.start for each in row_slices(rows, 1 + len(self.helpers))]


def _plan_eigenproblem(size: int, tallies: list[Tally], team: tuple[int, ...]) -> None:
    """Add the eigenproblem of a merge to the tallies of the ranks that share it."""
    ranks = len(team)
    if ranks == 1:
        tallies[team[0]].flops += eigen_flops(size, True)
        return
    for number, rank in enumerate(team):
        count_shared_eigenproblem(tallies[rank], size, True, ranks)
        if number:
            rows, columns = places(size, number, ranks)
            part = REAL_BYTES * len(rows) * len(columns)
            _send(tallies[team[0]], REAL_BYTES, part, part)
            _send(tallies[rank], part)


def _send(tally: Tally, *sizes: float) -> None:
    """Add the announcement and arrays of so many bytes; empty ones need no message."""
    tally.messages += 1 + sum(size > 0 for size in sizes)
    tally.bytes += HEADER_BYTES + sum(sizes)


def _send_group(sizes: TreeSizes, group: int, modes: int, tally: Tally) -> None:
    boundary = sizes.boundary[group]
    tally.messages += _GROUP_MESSAGES
    tally.bytes += HEADER_BYTES + sizes.element_bytes * sizes.crossing[group]
    tally.bytes += REAL_BYTES * (modes + boundary + 3 * boundary * modes)
