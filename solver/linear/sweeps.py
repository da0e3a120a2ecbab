"""Compiled sweeps of a multifrontal solve, up and down the fronts of a part of the tree."""

from pathlib import Path

from carillon.numerics import small_gemm
from carillon.numerics.simd import compiler
from carillon.numerics.simd_width import LANES
from carillon.numerics.small_gemm import block, subtract
from solver.linear import plan
from solver.linear.plan import PANEL, STRIP

compiled = compiler(Path(__file__), Path(small_gemm.__file__), Path(plan.__file__))


@compiled
def take_rows(vectors, start, width, nodes, lanes, work):  # type: ignore[no-untyped-def]
    """Rows of `nodes` of the columns from `start` on, as the first rows of a block."""
    flat = work.reshape(-1)
    for a in range(len(nodes)):
        for i in range(3):
            row = (3 * a + i) * lanes * LANES
            flat[row : row + width] = vectors[3 * nodes[a] + i, start : start + width]


@compiled
def put_rows(work, nodes, lanes, vectors, start, width):  # type: ignore[no-untyped-def]
    """The inverse of `take_rows`."""
    flat = work.reshape(-1)
    for a in range(len(nodes)):
        for i in range(3):
            row = (3 * a + i) * lanes * LANES
            vectors[3 * nodes[a] + i, start : start + width] = flat[row : row + width]


@compiled
def copy_nodes(source, place, nodes, lanes, target):  # type: ignore[no-untyped-def]
    """Rows of `nodes` of a block become the rows of another from `place` on."""
    size = 3 * lanes
    for a in range(len(nodes)):
        row = place * lanes + size * a
        target[row : row + size] = source[size * nodes[a] : size * (nodes[a] + 1)]


@compiled
def add_nodes(source, place, nodes, lanes, target):  # type: ignore[no-untyped-def]
    """The rows of a block from `place` on are added to the rows of `nodes` of another."""
    size = 3 * lanes
    for a in range(len(nodes)):
        row = place * lanes + size * a
        target[size * nodes[a] : size * (nodes[a] + 1)] += source[row : row + size]


@compiled
def _largest(first, near_offset):  # type: ignore[no-untyped-def]
    tallest = longest = 0
    for number in range(len(first) - 1):
        tallest = max(tallest, 3 * (first[number + 1] - first[number]))
        longest = max(longest, 3 * (near_offset[number + 1] - near_offset[number]))
    return tallest, longest


@compiled
def eliminate(  # type: ignore[no-untyped-def]
    work, lanes, fronts, first, near, near_offset, pivots, pivot_offset, coupling, coupling_offset
):
    """Forward sweep over the fronts of a part, and the inverse pivots: children before parents."""
    tallest, longest = _largest(first, near_offset)
    inside, outside = block(tallest, lanes), block(longest, lanes)
    for number in range(len(fronts)):
        front, top = fronts[number], 3 * first[number]
        n = 3 * first[number + 1] - top
        panels = -(-n // PANEL)
        place = pivot_offset[front]
        for panel in range(panels):
            start, stop = -(-n * panel // panels), -(-n * (panel + 1) // panels)
            size, rest = stop - start, n - stop
            later = (pivots, place + size * size, 1, rest)
            subtract(later, rest, size, (work, top + start, lanes), (work, top + stop, lanes))
            place += size * (size + rest)
        rows = near[near_offset[number] : near_offset[number + 1]]
        outside[: 3 * len(rows) * lanes] = 0.0
        for start in range(0, 3 * len(rows), STRIP):
            size = min(STRIP, 3 * len(rows) - start)
            strip = (coupling, coupling_offset[front] + n * start, 1, size)
            subtract(strip, size, n, (work, top, lanes), (outside, start, lanes))
        add_nodes(outside, 0, rows, lanes, work)
        place = pivot_offset[front]
        for panel in range(panels):
            start, stop = -(-n * panel // panels), -(-n * (panel + 1) // panels)
            size = stop - start
            inside[: size * lanes] = 0.0
            own = (work, top + start, lanes)
            subtract((pivots, place, size, 1), size, size, own, (inside, 0, lanes))
            work[(top + start) * lanes : (top + stop) * lanes] = -inside[: size * lanes]
            place += size * (n - start)


@compiled
def substitute(  # type: ignore[no-untyped-def]
    work, lanes, fronts, first, near, near_offset, pivots, pivot_offset, coupling, coupling_offset
):
    """Backward sweep over the fronts of a part, from parents to children."""
    outside = block(_largest(first, near_offset)[1], lanes)
    for number in range(len(fronts) - 1, -1, -1):
        front, top = fronts[number], 3 * first[number]
        n = 3 * first[number + 1] - top
        rows = near[near_offset[number] : near_offset[number + 1]]
        copy_nodes(work, 0, rows, lanes, outside)
        for start in range(0, 3 * len(rows), STRIP):
            size = min(STRIP, 3 * len(rows) - start)
            strip = (coupling, coupling_offset[front] + n * start, size, 1)
            subtract(strip, n, size, (outside, start, lanes), (work, top, lanes))
        panels = -(-n // PANEL)
        place = pivot_offset[front + 1]
        for panel in range(panels - 1, -1, -1):
            start, stop = -(-n * panel // panels), -(-n * (panel + 1) // panels)
            size, rest = stop - start, n - stop
            later = (pivots, place - size * rest, rest, 1)
            subtract(later, size, rest, (work, top + stop, lanes), (work, top + start, lanes))
            place -= size * (size + rest)
