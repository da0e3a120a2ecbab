"""Operations, bytes and messages of the busiest rank in every phase, counted without doing them.

All of it are closed forms of compact solids: subdomains are equally large and joined in pairs, a
group of n nodes has 6 n^(2/3) on its boundary, and nested dissection starts with a separator of
s = 3 n^(2/3) unknowns, so that a factorisation takes about 4 s^3 operations and its factor has
2 s^2 entries.
"""

from collections.abc import Mapping
from math import ceil
from typing import Any

from solver.hcms.counts import (
    Tally,
    count_shared_eigenproblem,
    eigen_flops,
    krylov_flops,
    product_flops,
)
from solver.hcms.schedule import modes_to_keep
from solver.hcms.synthesis import local_steps

REAL_BYTES = 8
MERGE_MESSAGES = 10
"""Messages that a rank sends for a merge with the group of another."""
DENSE_PROBLEMS = 3
"""Dense eigenproblems of the Krylov space that a correction solves on one rank."""

Work = dict[str, Tally]


def busiest(unknowns: float, subdomains: int, run: Mapping[str, Any], ranks: int) -> Work:
    """Work of the busiest rank in every phase, as tallies without times.

    A measured `run` says what is computed on any number of ranks: modes that the root of the merge
    tree may `keep`, `blocks` of `right_hand_sides` of the correction, its `width` in modes.
    """
    leaf, mine = unknowns / subdomains, ceil(subdomains / ranks)
    modes = [min(modes_to_keep(1.0 / subdomains, run["keep"]), int(leaf))]
    down, merges = Tally(), {}
    for level in range(1, (subdomains - 1).bit_length() + 1):
        groups = max(1.0, subdomains / 2**level)
        root, size = groups == 1.0, 2 * modes[-1]
        child, joined = min(leaf * 2 ** (level - 1), unknowns), min(leaf * 2**level, unknowns)
        modes.append(min(modes_to_keep(1.0 / groups, run["keep"]), size))
        # Several ranks share a merge, or one has several of them.
        team, each = max(1, int(ranks / groups)), max(1.0, groups / ranks)
        merge = Tally(flops=each * _products(joined, size, 0 if root else modes[-1]) / team)
        if team == 1:
            merge.flops += each * eigen_flops(size, True)
        else:
            count_shared_eigenproblem(merge, size, True, team)
            merge.messages += MERGE_MESSAGES
            merge.bytes += REAL_BYTES * modes[-2] * (min(child, _boundary(child)) + size)
            down.messages += 2
            down.bytes += REAL_BYTES * modes[-2] * run["keep"]
        if not root:
            down.flops += each * 2.0 * product_flops(modes[-2], modes[-1], run["keep"])
        merges[f"merge {level}"] = merge
    down.messages += 2 * (ranks - 1)
    down.bytes += REAL_BYTES * (ranks - 1) * (1 + modes[-1])
    krylov = krylov_flops(int(leaf), modes[0], local_steps(subdomains))
    return {
        "assembly": Tally(flops=mine * leaf),
        "local": Tally(flops=mine * krylov),
        **merges,
        "down": down,
        "basis": Tally(flops=mine * product_flops(int(leaf), modes[0], modes[-1]) if merges else 0),
        **_correction(unknowns, mine * leaf, run, ranks),
    }


def _products(unknowns: float, size: int, joined: int) -> float:
    """Products of a merge: at the face where two compact groups meet, and for the joined boundary.

    The stiffness at the face is projected on the modes of either group and on both, `size` in all;
    but for the root, the joined modes are formed on the boundary.
    """
    face = 3.0 * (unknowns / 3.0) ** (2.0 / 3.0)
    return 1.5 * face * size**2 + _boundary(unknowns) * size * joined


def _correction(unknowns: float, largest: float, run: Mapping[str, Any], ranks: int) -> Work:
    """Work of the block Lanczos iteration, where the busiest rank has `largest` of the unknowns.

    The ranks share factorisation, solves, the projection of every block on all before it and the
    modes; the dense problems of the Krylov space are the first rank's.
    """
    blocks, solves = run["blocks"], run["right_hand_sides"]
    columns = solves / max(blocks, 1)
    rounds = (ranks - 1).bit_length()
    separator = 3.0 * (unknowns / 3.0) ** (2.0 / 3.0)
    fronts = [separator * 0.5 ** (2.0 * level / 3.0) for level in range(rounds)]
    shared = 2.0 * solves**2 + 6.0 * columns * solves + 2.0 * solves * run["width"]
    alone = DENSE_PROBLEMS * eigen_flops(solves, False)
    outside = _boundary(largest) if ranks > 1 else 0.0
    reduced = rounds * solves * (0.5 * solves + 2.0 * columns)
    return {
        "factor": Tally(
            rounds,
            REAL_BYTES * sum(0.5 * front**2 for front in fronts),
            4.0 * separator**3 / ranks,
        ),
        "solve": Tally(
            2 * rounds * max(blocks, 1),
            REAL_BYTES * sum(2.0 * front * solves for front in fronts),
            8.0 * separator**2 * solves / ranks,
        ),
        "dense": Tally(
            6 * rounds * blocks,
            REAL_BYTES * (4.0 * outside * solves + reduced),
            largest * shared + alone,
        ),
    }


def _boundary(unknowns: float) -> float:
    """Unknowns on the boundary of a compact group."""
    return 18.0 * (unknowns / 3.0) ** (2.0 / 3.0)
