"""Additions, multiplications, divisions and roots that the kernel performs for one block.

Counted from the tables that steer it, as they are carried out: all nine numbers of a tile on the
diagonal, and a multiplication and an addition for each term of a product.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from dataset_gen.objectives.elimination import TILE, FactorStructure, Links, Sum
from dataset_gen.objectives.kernel import MOTIONS, STRAINS

INVERTED_ROOT = 28
"""Operations on a tile of the diagonal: three roots, three divisions and what goes with them."""
TILE_PRODUCT = 2 * 27
"""Operations of the product of two tiles."""

_counter: ContextVar[list[int] | None] = ContextVar("counter", default=None)


@contextmanager
def counted() -> Iterator[list[int]]:
    """Collect what `count` is told meanwhile."""
    counts: list[int] = []
    token = _counter.set(counts)
    try:
        yield counts
    finally:
        _counter.reset(token)


def count(flops: int) -> None:
    """Report operations to those who count."""
    counts = _counter.get()
    if counts is not None:
        counts.append(flops)


def assembly(*sums: Sum) -> int:
    """Operations that assemble tiles."""
    return sum(2 * len(terms.values) for terms in sums)


def factorisation(factor: FactorStructure) -> int:
    """Operations that factorise a matrix."""
    products = len(factor.updated) + len(factor.columns.tile)
    return TILE_PRODUCT * products + INVERTED_ROOT * len(factor.diagonal)


def substitution(factor: FactorStructure, columns: int) -> int:
    """Operations that solve with L or with its transpose."""
    return 2 * TILE * columns * (len(factor.rows.tile) + len(factor.diagonal))


def sparse_product(links: Links, columns: int) -> int:
    """Operations that multiply linked tiles and a matrix of so many columns."""
    return 2 * TILE * columns * len(links.tile)


def product(rows: int, columns: int, depth: int) -> int:
    """Operations of a product of full matrices."""
    return 2 * rows * columns * depth


def normal_equations(fields: int) -> int:
    """Operations from motions and fine energies of so many fields to the normal equations."""
    nodes = fields // 3
    tiles = nodes * (nodes + 1) // 2
    forms = 8 * tiles * TILE * 2 * 6
    inner = 6 * TILE * 2 * (tiles * TILE + 1)
    return product(fields, STRAINS, MOTIONS) + forms + inner


def flexibility(factor: FactorStructure, width: int) -> int:
    """Operations that find trace and norm of K^+; `width` motions without strain.

    Six columns of the inverse at a time, each from its own node down, and the sums of squares.
    """
    nodes, size = len(factor.diagonal), 3 * len(factor.diagonal)
    total = 2 * substitution(factor, width) + product(width, width, size) + 2 * width * size
    for first in range(0, nodes, 2):
        kept = sum(
            int((factor.rows.node[factor.rows.start[i] : factor.rows.start[i + 1]] >= first).sum())
            for i in range(first, nodes)
        )
        total += 2 * 2 * TILE * 6 * (kept + nodes - first) + 2 * 6 * 3 * (nodes - first)
    return total
