"""How the matrices of a front lie in memory: in panels of own rows, and strips of rows beyond."""

from carillon.processes.threads import split

PANEL = 120
"""Number of rows of a front that are eliminated together."""
STRIP = 192
"""Number of columns of W, and of rows of an update, that lie together in memory: whole nodes."""


def panels_of(n: int) -> list[tuple[int, int]]:
    """Half-open ranges of n own rows that are eliminated together."""
    return split(n, 1, PANEL)


def pivot_entries(n: int) -> int:
    """Entries of the panels of n own rows, each from its first column on."""
    return sum((stop - start) * (n - start) for start, stop in panels_of(n))


def packed_size(rows: int) -> int:
    """Entries of a symmetric matrix whose upper triangle is kept in strips of rows."""
    strips, rest = divmod(rows, STRIP)
    return strips * STRIP * rows - STRIP * STRIP * strips * (strips - 1) // 2 + rest * rest
