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
    eigen_flops,
    krylov_flops,
    product_flops,
    sparse_product_flops,
)
from solver.hcms.synthesis import local_steps, modes_to_keep
from solver.studies.scaling.sizes import TreeSizes

HEADER_BYTES = 8 * (MOST_ARRAYS + 1) * (2 + MOST_DIMENSIONS)
"""Bytes of the announcement that goes before the arrays of a message."""
REAL_BYTES = 8
_GROUP_MESSAGES = 8
"""Announcement, eigenvalues, boundary, modes there, three arrays of cells, projection."""


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
    leader = [int(owner[start]) for start, _ in tree.ranges()]
    modes = _modes(sizes, keep)
    root, steps = modes[-1], local_steps(tree.parts)
    for part in range(tree.parts):
        rank, unknowns = counts[int(owner[part])], 3 * sizes.nodes[part]
        rank.local.flops += krylov_flops(int(unknowns), modes[part], steps)
        if tree.merges:
            rank.basis.flops += product_flops(int(unknowns), modes[part], root)
    for number, step in enumerate(tree.merges):
        here, there = leader[step.left], leader[step.right]
        level = levels[step.group] - 1
        _plan_merge(
            sizes,
            number,
            modes,
            counts[here].merges[level],
            counts[there].merges[level],
            here != there,
        )
        last = step.group == len(levels) - 1
        down = counts[here].down
        for child in (step.left, step.right):
            if not last:
                down.flops += product_flops(modes[child], modes[step.group], root)
            if leader[child] != here:
                down.messages += 2
                down.bytes += HEADER_BYTES + REAL_BYTES * modes[child] * root
    top = counts[leader[-1]].down
    top.messages += 2 * (ranks - 1)
    top.bytes += (ranks - 1) * REAL_BYTES * (1 + root)
    return counts


def _modes(sizes: TreeSizes, keep: int) -> list[int]:
    """Modes that every group keeps."""
    modes: list[int] = []
    for group, nodes in enumerate(sizes.nodes):
        requested = modes_to_keep(nodes / sizes.nodes[-1], keep)
        if group < sizes.tree.parts:
            available = int(3 * nodes)
        else:
            step = sizes.tree.merges[group - sizes.tree.parts]
            available = modes[step.left] + modes[step.right]
        modes.append(min(requested, available))
    return modes


def _plan_merge(
    sizes: TreeSizes,
    number: int,
    modes: list[int],
    here: Tally,
    there: Tally,
    apart: bool,
) -> None:
    """Add a merge to the tallies of the rank that makes it and of the right group's leader."""
    step = sizes.tree.merges[number]
    left, right, joined = modes[step.left], modes[step.right], modes[step.group]
    rows_left = int(3 * sizes.rows_left[number])
    rows_right = int(3 * sizes.rows_right[number])
    here.flops += _projection(left, rows_left, left, 9 * sizes.pairs_left[number])
    there.flops += _projection(right, rows_right, right, 9 * sizes.pairs_right[number])
    here.flops += _projection(right, rows_right, left, 9 * sizes.pairs_across[number])
    here.flops += _projection(right, rows_right, left, 3 * sizes.pairs_across[number])
    here.flops += eigen_flops(left + right, True)
    boundary_left = int(3 * sizes.boundary_left[number])
    boundary_right = int(3 * sizes.boundary[step.group]) - boundary_left
    here.flops += product_flops(boundary_left, left, joined)
    here.flops += product_flops(boundary_right, right, joined)
    if apart:
        boundary = sizes.boundary[step.right]
        there.messages += _GROUP_MESSAGES
        there.bytes += HEADER_BYTES + sizes.element_bytes * sizes.crossing[step.right]
        there.bytes += REAL_BYTES * (right + boundary + 3 * boundary * right + right**2)


def _projection(rows: int, inner: int, columns: int, entries: float) -> float:
    """Flops of modes^T matrix others."""
    return sparse_product_flops(int(entries), columns) + product_flops(rows, inner, columns)
