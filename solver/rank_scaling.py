"""Wall time of block Lanczos on any number of ranks, by the size of a compact solid alone:

    t(phase) = flops / rate + bytes / bandwidth + messages * latency    of the busiest rank

No solid is partitioned and nothing is run.  Nested dissection eliminates at level k 2^k fronts of
s 2^(-2k/3) unknowns each, where s is proportional to (nodes)^(2/3).  The fronts of the first
log2(ranks) levels are shared by the ranks of a half, a quarter, ... (`solver.linear.rank_tree`),
all others are those of single ranks.  Constants are those of the solver's own counts (operations of
`RankTree`) of a bunny of 78,462 and of 251,091 unknowns on 1 to 16 ranks.
"""

from math import ceil, log2
from typing import NamedTuple

SEPARATOR = 2.55
"""Unknowns of the first separator over (nodes)^(2/3)."""
BEYOND_A_LEVEL, MOST_BEYOND = 1.4, 5.0
"""Unknowns that a front is coupled to, over its own: by level, and at most."""
LEAF = 30.0
"""Unknowns of the smallest fronts."""
PANEL = 192
"""Rows that a rank holds together, and that are swept out together: `solver.linear.plan.STRIP`."""
FRONT_COST = 1.2
"""Time of an operation in a shared front over one in a front of a single rank."""
RATES = {"factor": 33e9, "solve": 35e9, "dense": 10e9}
"""Operations per second of one core of an AMD EPYC by kind of phase, in large solids."""
LATENCY, BANDWIDTH = 2e-6, 5e9
"""Latency of a message [s] and bandwidth [B/s] of a fast network, assumed."""
BLOCK = 16
"""Right-hand sides that are solved together."""
COUPLED = 81
"""Entries in a row of the stiffness or of the mass."""
DENSE_PROBLEM = 14.0
"""Operations of the dense eigenproblems of the Krylov space over the cube of its dimension: three
of 14/3 each, on one rank."""
ALONE = 1.4e-5
"""Time in which the first rank alone makes mesh and material, for each unknown [s]."""
THREADED = 0.75
"""Share of a solve that threads of a rank divide: two take 1.6 times as little as one."""
ASSUMPTIONS = (
    "the solid is compact: fronts shrink by 2^(2/3) a level, equally in all branches",
    "levels of the tree follow each other, and all ranks of a front have equally many of its "
    f"panels of {PANEL} rows, but one at least: more ranks than panels do not help",
    f"an operation in a shared front takes {FRONT_COST:g} times as long as one in other fronts",
    "an Allgatherv takes log2(ranks) messages and its payload once, an Alltoallv a message to each "
    "rank",
    "the dense eigenproblem of the Krylov space is solved by one rank",
)
"""Assumptions of the factorisation, the solves and the products."""


class Share(NamedTuple):
    """Work of the busiest rank in a phase."""

    flops: float
    bytes: float = 0.0
    messages: float = 0.0
    """Messages that it sends or waits for one after the other, and the bytes in them."""


def factorisation(unknowns: float, ranks: int) -> tuple[Share, Share]:
    """Work in the fronts of a single rank and in those that it shares."""
    inside = sum(
        2**level * (own**3 / 3.0 + own**2 * beyond + own * beyond**2)
        for level, (own, beyond) in enumerate(_fronts(unknowns))
        if level >= _rounds(ranks)
    )
    flops = size = messages = 0.0
    for sharing, own, beyond in _shared(unknowns, ranks):
        rows = own + beyond
        # A rank has a strip at least, whose rectangle is as wide as the front.
        strip, panel = min(rows, PANEL), min(own, PANEL)
        flops += FRONT_COST * own * (rows + 2.0 * panel) * (max(rows / sharing, strip) + strip)
        size += 8.0 * (own * rows + (own**2 + rows**2) / sharing)
        messages += ceil(own / PANEL) * _rounds(sharing) + 2.0 * sharing
    return Share(inside / ranks), Share(flops, size, messages)


def solves(unknowns: float, ranks: int, blocks: float, columns: float) -> Share:
    """Work of solves for so many `columns` in all, in so many `blocks`."""
    flops = size = messages = 0.0
    for level, (own, beyond) in enumerate(_fronts(unknowns)):
        if level >= _rounds(ranks):
            flops += 2**level * own * (2.0 * own + 4.0 * beyond) / ranks
    for sharing, own, beyond in _shared(unknowns, ranks):
        flops += max(own / sharing, min(own, PANEL)) * (2.0 * own + 4.0 * beyond)
        size += 24.0 * own
        messages += 2.0 * _rounds(sharing) + sharing
    return Share(columns * flops, columns * size, blocks * messages)


def products(own: float, ranks: int, blocks: float, columns: float, width: float) -> Share:
    """Work on `own` unknowns: products with the mass and the stiffness, and of blocks.

    Every block is projected on all before it, and `width` modes are formed and verified.
    """
    of_blocks = 2.0 * columns**2 + 6.0 * columns / max(blocks, 1) * columns + 2.0 * columns * width
    sparse = 2.0 * COUPLED * (columns + 2.0 * width)
    outside = 18.0 * (own / 3.0) ** (2.0 / 3.0) if ranks > 1 else 0.0
    reduced = _rounds(ranks) * columns * (0.5 * columns + 2.0 * columns / max(blocks, 1))
    size = 8.0 * (4.0 * outside * columns + reduced)
    return Share(own * (of_blocks + sparse), size, 6.0 * _rounds(ranks) * blocks)


def modelled_seconds(
    unknowns: float,
    modes: float,
    ranks: int,
    latency: float = LATENCY,
    bandwidth: float = BANDWIDTH,
) -> dict[str, float]:
    """Seconds of block Lanczos from moduli to verified modes, by what takes them.

    About twice as many right-hand sides are solved as there are `modes`, to 10^-6.
    """
    columns = 2.0 * modes + 3.0 * BLOCK
    blocks = columns / BLOCK
    own, shared = factorisation(unknowns, ranks)
    solving = solves(unknowns, ranks, blocks, columns)
    dense = products(unknowns / ranks, ranks, blocks, columns, 1.15 * modes)
    parts = own, shared, solving, dense
    return {
        "own rows": own.flops / RATES["factor"],
        "shared fronts": shared.flops / RATES["factor"],
        "solves": solving.flops / RATES["solve"],
        "products": dense.flops / RATES["dense"],
        "dense problem": DENSE_PROBLEM * columns**3 / RATES["dense"],
        "bytes": sum(part.bytes for part in parts) / bandwidth,
        "latency": sum(part.messages for part in parts) * latency,
    }


def speed_up(
    unknowns: float,
    modes: float,
    ranks: int,
    alone: float = 0.0,
    latency: float = LATENCY,
    bandwidth: float = BANDWIDTH,
) -> float:
    """How many times as fast block Lanczos is on so many ranks of one core as on one.

    `alone` [s] is what else one rank does while the others wait.

    Examples
    --------
    >>> [round(speed_up(250_000, 64, ranks), 1) for ranks in (1, 2, 4)]
    [1.0, 1.9, 3.3]
    """
    one, many = (
        alone + sum(modelled_seconds(unknowns, modes, n, latency, bandwidth).values())
        for n in (1, ranks)
    )
    return one / many


def thread_speed_up(threads: int) -> float:
    """How many times as fast a rank is with so many threads as with one."""
    return 1.0 / (1.0 - THREADED + THREADED / threads)


def _fronts(unknowns: float) -> list[tuple[float, float]]:
    """Own unknowns of a front of each level, and those that it is coupled to."""
    first = SEPARATOR * (unknowns / 3.0) ** (2.0 / 3.0)
    levels = max(1, ceil(1.5 * log2(max(first / LEAF, 1.0))))
    return [_front(first, level) for level in range(levels)]


def _shared(unknowns: float, ranks: int) -> list[tuple[float, float, float]]:
    """Ranks that share a front, its own unknowns and those beyond, for the levels shared."""
    first = SEPARATOR * (unknowns / 3.0) ** (2.0 / 3.0)
    return [(ranks / 2**level, *_front(first, level)) for level in range(_rounds(ranks))]


def _front(first: float, level: int) -> tuple[float, float]:
    own = first * 2.0 ** (-2.0 * level / 3.0)
    return own, own * min(BEYOND_A_LEVEL * level, MOST_BEYOND)


def _rounds(ranks: float) -> int:
    """Levels of the tree of halves of so many ranks."""
    return ceil(log2(ranks)) if ranks > 1 else 0
