"""Operations, bytes and messages of the busiest rank in every phase, counted without doing them.

They follow from the nodes of the groups of a merge tree, from the solver's own schedule of merges,
and from closed forms for compact solids: a group of n nodes has 6 n^(2/3) on its boundary; the
correction is that of `solver.rank_scaling`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from solver.distribution.decomposition import COST_EXPONENT
from solver.distribution.tree import Merge, MergeTree, assign_ranks
from solver.hcms.counts import (
    Tally,
    count_shared_eigenproblem,
    eigen_flops,
    krylov_flops,
    product_flops,
)
from solver.hcms.schedule import planned_modes, schedule
from solver.hcms.synthesis import local_steps
from solver.rank_scaling import DENSE_PROBLEM, Share, factorisation, products, solves

REAL_BYTES = 8

Work = dict[str, Tally]


@dataclass(frozen=True)
class Request:
    """What is computed, on any number of ranks."""

    keep: int
    """Modes kept at the root of the merge tree."""
    blocks: int
    solves: int
    """Blocks of right-hand sides of the correction, and their columns in all."""
    width: int
    """Modes that it forms."""

    @classmethod
    def of_run(cls, run: dict[str, Any]) -> Request:
        """That of a measured run."""
        return cls(run["keep"], run["blocks"], run["right_hand_sides"], run["width"])


def busiest(tree: MergeTree, nodes: Sequence[float], request: Request, ranks: int) -> Work:
    """Work of the busiest rank in every phase, as tallies without times.

    `nodes`: (groups,) nodes of every group of `tree`.
    """
    unknowns = 3.0 * np.asarray(nodes)
    owner = assign_ranks(np.asarray(nodes[: tree.parts]) ** COST_EXPONENT, ranks)
    modes = planned_modes(tree, nodes, request.keep)
    steps = local_steps(tree.parts)
    local, basis = np.zeros((2, ranks))
    for part, rank in enumerate(owner):
        local[rank] += krylov_flops(int(unknowns[part]), modes[part], steps)
        basis[rank] += product_flops(int(unknowns[part]), modes[part], modes[-1])
    return {
        "assembly": Tally(flops=float(unknowns[-1]) / ranks),
        "local": Tally(flops=float(local.max())),
        **_synthesis(tree, nodes, modes, owner, request.keep, ranks),
        "basis": Tally(flops=float(basis.max()) if tree.merges else 0.0),
        **_correction(float(unknowns[-1]), request, ranks),
    }


def balanced_tree(levels: int) -> MergeTree:
    """Merge tree of 2^levels subdomains, joined in pairs."""
    parts = 1 << levels
    merges = [Merge(parts + i, 2 * i, 2 * i + 1) for i in range(parts - 1)]
    return MergeTree(parts, tuple(merges))


def _synthesis(
    tree: MergeTree, nodes: Sequence[float], modes: list[int], owner: Any, keep: int, ranks: int
) -> Work:
    """Work of the merges, level by level, and of the coefficients on their way back."""
    plan, levels = schedule(tree, owner, nodes, keep), tree.levels()
    phases = {f"merge {level}": _tallies(ranks) for level in range(1, levels[-1] + 1)}
    down = _tallies(ranks)
    merges = zip(tree.merges, plan.teams, plan.crews, plan.exchanges, strict=True)
    for step, team, crews, exchange in merges:
        merge = phases[f"merge {levels[step.group]}"]
        here, size = plan.holder[step.group], modes[step.left] + modes[step.right]
        products = _product_flops(nodes, modes, step, root=step.group == len(nodes) - 1)
        merge[here].flops += products / (1 + len(crews[0]) + len(crews[1]))
        for rank in team:
            if len(team) == 1:
                merge[rank].flops += eigen_flops(size, True)
            else:
                count_shared_eigenproblem(merge[rank], size, True, len(team))
        for child in (step.left, step.right):
            there = plan.holder[child]
            if step.group < len(nodes) - 1:
                down[here].flops += product_flops(modes[child], modes[step.group], modes[-1])
            if there != here:
                rows = min(3.0 * nodes[child], 3.0 * _boundary(nodes[child]))
                merge[there].messages += 2 if exchange else 1
                merge[there].bytes += REAL_BYTES * modes[child] * (rows + size)
                down[here].messages += 1
                down[here].bytes += REAL_BYTES * modes[child] * modes[-1]
    return {name: _largest(tallies) for name, tallies in {**phases, "down": down}.items()}


def _product_flops(nodes: Sequence[float], modes: list[int], step: Merge, root: bool) -> float:
    """Products of a merge: at the face where two compact groups meet, and for the joined boundary.

    The stiffness at the face is projected on the modes of either group and on both; but for the
    root, the joined modes are formed on the boundary.
    """
    left, right, joined = (modes[group] for group in (step.left, step.right, step.group))
    face = 3.0 * nodes[step.group] ** (2.0 / 3.0)
    boundary = 0.0 if root else 3.0 * _boundary(nodes[step.group])
    projected = 2.0 * face * (left**2 + right**2 + left * right)
    return projected + boundary * (left + right) * joined


def _correction(unknowns: float, request: Request, ranks: int) -> Work:
    """Work of the block Lanczos iteration on rows that are cut by planes, equally many a rank."""
    blocks, columns = request.blocks, request.solves
    own, shared = factorisation(unknowns, ranks)
    dense = products(unknowns / ranks, ranks, blocks, columns, request.width)
    alone = Share(DENSE_PROBLEM * float(columns) ** 3)
    return {
        "factor": _tally(own, shared),
        "solve": _tally(solves(unknowns, ranks, blocks, columns)),
        "dense": _tally(dense, alone),
    }


def _tally(*shares: Share) -> Tally:
    """Work that one rank does one after the other."""
    flops, size, messages = (sum(each) for each in zip(*shares, strict=True))
    return Tally(messages, size, flops)


def _boundary(nodes: float) -> float:
    """Nodes on the boundary of a compact group."""
    return 6.0 * nodes ** (2.0 / 3.0)


def _tallies(ranks: int) -> list[Tally]:
    return [Tally() for _ in range(ranks)]


def _largest(tallies: list[Tally]) -> Tally:
    return Tally(
        max(each.messages for each in tallies),
        max(each.bytes for each in tallies),
        max(each.flops for each in tallies),
    )
