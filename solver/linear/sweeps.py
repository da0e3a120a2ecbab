"""Compiled sweeps of a multifrontal solve, up and down the tree, that threads share by tickets.

A block has a row for every unknown in the order of elimination, and rows of each part of the tree
for those beyond it: see `solver.linear.shares`.  What comes out depends on the parts alone.
"""

from pathlib import Path

import numpy as np

from carillon.numerics import small_gemm, tickets
from carillon.numerics.simd import compiler, empty
from carillon.numerics.simd_width import LANES
from carillon.numerics.small_gemm import subtract
from carillon.numerics.tickets import increase, wait_for
from solver.linear import panels, shares
from solver.linear.panels import PANEL, STRIP
from solver.linear.shares import BRANCH, PANEL_OF_FRONT

compiled = compiler(
    *(Path(each) for each in (__file__, small_gemm.__file__, tickets.__file__)),
    *(Path(each) for each in (panels.__file__, shares.__file__)),
)

COUNTERS = 3
"""Counters of a part: its tickets done, its panels done, and its slices gathered."""


@compiled
def _take(vectors, start, width, order, first, last, lanes, work):  # type: ignore[no-untyped-def]
    """Rows from `first` to `last` of a block: the columns of the vectors from `start` on."""
    flat = work.reshape(-1)
    for row in range(first, last):
        place = row * lanes * LANES
        flat[place : place + width] = vectors[3 * order[row // 3] + row % 3, start : start + width]
        flat[place + width : place + lanes * LANES] = 0.0


@compiled
def _put(work, lanes, order, first, last, vectors, start, width):  # type: ignore[no-untyped-def]
    """The inverse of `_take`."""
    flat = work.reshape(-1)
    for row in range(first, last):
        place = row * lanes * LANES
        vectors[3 * order[row // 3] + row % 3, start : start + width] = flat[place : place + width]


@compiled
def _add_nodes(source, nodes, lanes, work):  # type: ignore[no-untyped-def]
    """The rows of `source` are added to the rows of `nodes` of a block."""
    size = 3 * lanes
    for a in range(len(nodes)):
        work[size * nodes[a] : size * (nodes[a] + 1)] += source[size * a : size * (a + 1)]


@compiled
def _add_children(number, tree, first, last, counters, lanes, work):  # type: ignore[no-untyped-def]
    """Add to the rows from `first` to `last` of a part what its children have for them."""
    parts, child_offset, child, taken_offset, taken = tree
    for place in range(child_offset[number], child_offset[number + 1]):
        below = child[place]
        wait_for(counters, 1 + COUNTERS * below, parts[below, 6])
        nodes = taken[taken_offset[below] : taken_offset[below + 1]]
        a = np.searchsorted(nodes, first // 3)
        while a < len(nodes) and 3 * nodes[a] < last:
            for row in range(max(first, 3 * nodes[a]), min(last, 3 * nodes[a] + 3)):
                source = (3 * (parts[below, 3] + a) + row % 3) * lanes
                target = row * lanes
                work[target : target + lanes] += work[source : source + lanes]
            a += 1


@compiled
def _longest(tree, fronts):  # type: ignore[no-untyped-def]
    """Rows beyond a front at most."""
    offset = fronts[1]
    longest = 0
    for front in range(len(offset) - 1):
        longest = max(longest, 3 * (offset[front + 1] - offset[front]))
    return longest


@compiled
def up(  # type: ignore[no-untyped-def]
    vectors, start, width, work, lanes, counters, tickets, tree, fronts, factor
):
    """Forward sweep of the columns from `start` on.

    Parameters
    ----------
    vectors, start, width
        Right-hand sides, and which of their columns.
    work, lanes
        Block, and registers to a row of it.
    counters
        Zeros, one more than `COUNTERS` for each part.
    tickets
        `Shares.up`.
    tree
        `Shares.parts`, `child_offset`, `child`, `taken_offset` and `taken`.
    fronts
        `Fronts.first`, `offset`, `order`, `Shares.near` and `Fronts.beyond`.
    factor
        Roots of inverse pivots with what couples panels, where those of each front begin, W, where
        that of each front begins, and signs of the own rows of all fronts.
    """
    outside = empty(_longest(tree, fronts) * lanes)
    inside = empty(PANEL * lanes)
    order, parts = fronts[2], tree[0]
    taken = increase(counters, 0)
    while taken < len(tickets):
        kind, number, begin, end = tickets[taken]
        own = 3 * fronts[0][parts[number, 0]]
        if kind == BRANCH:
            _take(vectors, start, width, order, own, 3 * fronts[0][parts[number, 1]], lanes, work)
            beyond = 3 * parts[number, 3] * lanes
            work[beyond : beyond + 3 * parts[number, 4] * lanes] = 0.0
            for front in range(parts[number, 0], parts[number, 1]):
                _eliminate(front, work, lanes, inside, outside, fronts, factor)
        elif kind == PANEL_OF_FRONT:
            columns = vectors, start, width
            _eliminate_panel(
                columns, number, begin, work, lanes, inside, counters, tree, fronts, factor
            )
            increase(counters, 2 + COUNTERS * number)
        else:
            _eliminate_slice(number, begin, end, work, lanes, counters, tree, fronts, factor)
        increase(counters, 1 + COUNTERS * number)
        taken = increase(counters, 0)


@compiled
def _bounds(n, panel):  # type: ignore[no-untyped-def]
    """Half-open range of a panel of n own rows, as `solver.linear.panels.panels_of`."""
    panels = -(-n // PANEL)
    return -(-n * panel // panels), -(-n * (panel + 1) // panels)


@compiled
def _eliminate(front, work, lanes, inside, outside, fronts, factor):  # type: ignore[no-untyped-def]
    """Take the own rows of a front of a branch off those beyond."""
    first, offset, _, near, _ = fronts
    pivots, pivot_offset, coupling, coupling_offset, _ = factor
    top = 3 * first[front]
    n = 3 * first[front + 1] - top
    place = pivot_offset[front]
    for panel in range(-(-n // PANEL)):
        start, stop = _bounds(n, panel)
        size, rest = stop - start, n - stop
        _apply_root(pivots, place, size, False, work, top + start, lanes, inside)
        later = (pivots, place + size * size, 1, rest)
        subtract(later, rest, size, (work, top + start, lanes), (work, top + stop, lanes))
        place += size * (size + rest)
    rows = near[offset[front] : offset[front + 1]]
    outside[: 3 * len(rows) * lanes] = 0.0
    for start in range(0, 3 * len(rows), STRIP):
        size = min(STRIP, 3 * len(rows) - start)
        strip = (coupling, coupling_offset[front] + n * start, 1, size)
        subtract(strip, size, n, (work, top, lanes), (outside, start, lanes))
    _add_nodes(outside, rows, lanes, work)


@compiled
def _eliminate_panel(  # type: ignore[no-untyped-def]
    columns, number, panel, work, lanes, inside, counters, tree, fronts, factor
):
    """Take the panels before off the rows of one of a shared front, and apply its root."""
    vectors, start, width = columns
    parts, (pivots, pivot_offset, _, _, _) = tree[0], factor
    front = parts[number, 0]
    top = 3 * fronts[0][front]
    n = 3 * fronts[0][front + 1] - top
    first, last = _bounds(n, panel)
    _take(vectors, start, width, fronts[2], top + first, top + last, lanes, work)
    _add_children(number, tree, top + first, top + last, counters, lanes, work)
    place = pivot_offset[front]
    for before in range(panel):
        wait_for(counters, 2 + COUNTERS * number, before + 1)
        begin, stop = _bounds(n, before)
        size, rest = stop - begin, n - stop
        later = (pivots, place + size * size + first - stop, 1, rest)
        own, target = (work, top + begin, lanes), (work, top + first, lanes)
        subtract(later, last - first, size, own, target)
        place += size * (size + rest)
    _apply_root(pivots, place, last - first, False, work, top + first, lanes, inside)


@compiled
def _eliminate_slice(  # type: ignore[no-untyped-def]
    number, begin, end, work, lanes, counters, tree, fronts, factor
):
    """Take the own rows of a shared front off a slice of those beyond."""
    parts, (_, _, coupling, coupling_offset, _) = tree[0], factor
    front = parts[number, 0]
    top, beyond = 3 * fronts[0][front], 3 * parts[number, 3]
    n = 3 * fronts[0][front + 1] - top
    work[(beyond + begin) * lanes : (beyond + end) * lanes] = 0.0
    _add_children(number, tree, beyond + begin, beyond + end, counters, lanes, work)
    wait_for(counters, 2 + COUNTERS * number, parts[number, 5])
    start = begin // STRIP * STRIP
    size = min(STRIP, 3 * parts[number, 4] - start)
    strip = (coupling, coupling_offset[front] + n * start + begin - start, 1, size)
    subtract(strip, end - begin, n, (work, top, lanes), (work, beyond + begin, lanes))


@compiled
def down(  # type: ignore[no-untyped-def]
    vectors, start, width, work, lanes, counters, tickets, tree, fronts, factor
):
    """Signs and backward sweep of the block of `up`, whose columns go to the vectors.

    See there for the parameters; `tickets` are `Shares.down`.
    """
    outside = empty(_longest(tree, fronts) * lanes)
    inside = empty(PANEL * lanes)
    order, parts, positions = fronts[2], tree[0], fronts[4]
    taken = increase(counters, 0)
    while taken < len(tickets):
        kind, number, begin, end = tickets[taken]
        above, first, last = parts[number, 2], parts[number, 0], parts[number, 1]
        if kind != PANEL_OF_FRONT and above >= 0:
            wait_for(counters, 1 + COUNTERS * above, parts[above, 7])
        if kind == BRANCH:
            for front in range(last - 1, first - 1, -1):
                _substitute(front, work, lanes, inside, outside, fronts, factor)
            own = 3 * fronts[0][first], 3 * fronts[0][last]
            _put(work, lanes, order, own[0], own[1], vectors, start, width)
        elif kind == PANEL_OF_FRONT:
            _substitute_panel(number, begin, work, lanes, inside, counters, tree, fronts, factor)
            top = 3 * fronts[0][first]
            begin, end = _bounds(3 * fronts[0][last] - top, begin)
            _put(work, lanes, order, top + begin, top + end, vectors, start, width)
            increase(counters, 2 + COUNTERS * number)
        else:
            near = positions[fronts[1][first] + begin // 3 : fronts[1][first] + end // 3]
            place = (3 * parts[number, 3] + begin) * lanes
            _copy_nodes(work, near, lanes, work[place:])
            increase(counters, 3 + COUNTERS * number)
        increase(counters, 1 + COUNTERS * number)
        taken = increase(counters, 0)


@compiled
def _copy_nodes(work, nodes, lanes, target):  # type: ignore[no-untyped-def]
    """Rows of `nodes` of a block become the first rows of `target`."""
    size = 3 * lanes
    for a in range(len(nodes)):
        target[size * a : size * (a + 1)] = work[size * nodes[a] : size * (nodes[a] + 1)]


@compiled
def _apply_root(  # type: ignore[no-untyped-def]
    pivots, place, size, transposed, work, row, lanes, inside
):
    """The rows of a panel become the root of its inverse pivot, or its transpose, times them."""
    inside[: size * lanes] = 0.0
    across, along = (1, size) if transposed else (size, 1)
    subtract((pivots, place, across, along), size, size, (work, row, lanes), (inside, 0, lanes))
    work[row * lanes : (row + size) * lanes] = -inside[: size * lanes]


@compiled
def _apply_signs(signs, first, size, lanes, work):  # type: ignore[no-untyped-def]
    """The own rows from `first` on become themselves times the signs."""
    for row in range(first, first + size):
        if signs[row] < 0.0:
            work[row * lanes : (row + 1) * lanes] = -work[row * lanes : (row + 1) * lanes]


@compiled
def _substitute(front, work, lanes, inside, outside, fronts, factor):  # type: ignore[no-untyped-def]
    """Solution for the own rows of a front of a branch."""
    first, offset, _, _, positions = fronts
    pivots, pivot_offset, coupling, coupling_offset, signs = factor
    top = 3 * first[front]
    n = 3 * first[front + 1] - top
    rows = positions[offset[front] : offset[front + 1]]
    _copy_nodes(work, rows, lanes, outside)
    _apply_signs(signs, top, n, lanes, work)
    for start in range(0, 3 * len(rows), STRIP):
        size = min(STRIP, 3 * len(rows) - start)
        strip = (coupling, coupling_offset[front] + n * start, size, 1)
        subtract(strip, n, size, (outside, start, lanes), (work, top, lanes))
    place = pivot_offset[front + 1]
    for panel in range(-(-n // PANEL) - 1, -1, -1):
        start, stop = _bounds(n, panel)
        size, rest = stop - start, n - stop
        later = (pivots, place - size * rest, rest, 1)
        subtract(later, size, rest, (work, top + stop, lanes), (work, top + start, lanes))
        place -= size * (size + rest)
        _apply_root(pivots, place, size, True, work, top + start, lanes, inside)


@compiled
def _substitute_panel(  # type: ignore[no-untyped-def]
    number, panel, work, lanes, inside, counters, tree, fronts, factor
):
    """Solution for a panel of a shared front, once that of the panels after it is known."""
    parts, (pivots, pivot_offset, coupling, coupling_offset, signs) = tree[0], factor
    front, beyond, count = parts[number, 0], 3 * parts[number, 3], 3 * parts[number, 4]
    top = 3 * fronts[0][front]
    n = 3 * fronts[0][front + 1] - top
    first, last = _bounds(n, panel)
    size, place = last - first, pivot_offset[front]
    for before in range(panel):
        begin, stop = _bounds(n, before)
        place += (stop - begin) * (n - begin)
    _apply_signs(signs, top + first, size, lanes, work)
    panels = parts[number, 5]
    wait_for(counters, 3 + COUNTERS * number, parts[number, 7] - panels)
    own = (work, top + first, lanes)
    for start in range(0, count, STRIP):
        wide = min(STRIP, count - start)
        strip = (coupling, coupling_offset[front] + n * start + first * wide, wide, 1)
        subtract(strip, size, wide, (work, beyond + start, lanes), own)
    for after in range(panels - 1, panel, -1):
        wait_for(counters, 2 + COUNTERS * number, panels - after)
        begin, stop = _bounds(n, after)
        later = (pivots, place + size * size + begin - last, n - last, 1)
        subtract(later, size, stop - begin, (work, top + begin, lanes), own)
    _apply_root(pivots, place, size, True, work, top + first, lanes, inside)
