"""Cuts of a graph whose vertices have places, where no plane passes between all elements.

What a plane leaves on either side is parted by the vertices on one of them that have neighbours on
the other: those on the plane where it passes between elements, and a few more where elements
straddle it.  Vertices are then moved out of such a separator one by one, and what they had for
neighbours on the other side into it, as long as that pays (Fiduccia & Mattheyses 1982, with
separators of vertices as of Ashcraft & Liu 1997).
"""

import numba
import numpy as np

BELOW, ABOVE, BETWEEN = range(3)
"""Sides of a cut, and what parts them."""
ROUNDS = 6
"""Number of rounds in which vertices move out of a separator at most."""
PATIENCE = 20
"""Moves without a smaller cost after which a round ends."""


@numba.njit(cache=True, nogil=True)
def halves(lattice, sizes, indptr, indices):  # type: ignore[no-untyped-def]
    """Side (n,) int8 of each vertex of a connected graph, of which no edge joins the two.

    The nodes between the sides are few, and the sides of similar size. All are between them if
    there is no such cut.

    Parameters
    ----------
    lattice
        (n, 3) integer coordinates.
    sizes
        (n,) nodes that each vertex stands for.
    indptr, indices
        Graph in compressed rows, without the diagonal.
    """
    result = np.full(len(sizes), BETWEEN, dtype=np.int8)
    lowest = np.inf
    for axis in range(3):
        side, cost = _beside_a_plane(lattice[:, axis], sizes, indptr, indices)
        if cost < np.inf:
            cost = _improved(side, sizes, indptr, indices, cost)
        if cost < lowest:
            result, lowest = side, cost
    return result


@numba.njit(cache=True, nogil=True)
def _cost(between, below, above):  # type: ignore[no-untyped-def]
    """Cost of a cut with so many nodes: small for few between two sides of similar size."""
    if min(below, above) <= 0:
        return np.inf
    return between / np.sqrt(float(below) * float(above))


@numba.njit(cache=True, nogil=True)
def planes_across(coordinate, sizes, indptr, indices):  # type: ignore[no-untyped-def]
    """Planes across an axis, each just above the vertices of one coordinate.

    Returns the number (n,) of the plane above each vertex, how many nodes are below each plane
    (p,), and how many of those on either side of it (2, p + 1) have neighbours beyond it.
    """
    lowest, highest = coordinate[0], coordinate[0]
    for value in coordinate:
        lowest, highest = min(lowest, value), max(highest, value)
    number_of = np.zeros(highest + 2 - lowest, dtype=np.int64)
    for value in coordinate:
        number_of[value + 1 - lowest] = 1
    for number in range(1, len(number_of)):
        number_of[number] += number_of[number - 1]
    planes = number_of[-1]
    plane = np.empty(len(coordinate), dtype=np.int64)
    for vertex in range(len(coordinate)):
        plane[vertex] = number_of[coordinate[vertex] - lowest]
    below = np.zeros(planes, dtype=np.int64)
    parting = np.zeros((2, planes + 1), dtype=np.int64)
    for vertex in range(len(sizes)):
        own = low = high = plane[vertex]
        for entry in range(indptr[vertex], indptr[vertex + 1]):
            low, high = min(low, plane[indices[entry]]), max(high, plane[indices[entry]])
        below[own] += sizes[vertex]
        parting[BELOW, own] += sizes[vertex]
        parting[BELOW, high] -= sizes[vertex]
        parting[ABOVE, low] += sizes[vertex]
        parting[ABOVE, own] -= sizes[vertex]
    for number in range(1, planes):
        below[number] += below[number - 1]
        for side in (BELOW, ABOVE):
            parting[side, number] += parting[side, number - 1]
    return plane, below, parting


@numba.njit(cache=True, nogil=True)
def sides_of(plane, last, parting, indptr, indices):  # type: ignore[no-untyped-def]
    """Side (n,) int8 of each vertex of the plane number `last`, see `planes_across`.

    Those on the side `parting` that have neighbours beyond the plane are between the sides.
    """
    sides = np.empty(len(plane), dtype=np.int8)
    for vertex in range(len(plane)):
        is_below = plane[vertex] <= last
        sides[vertex] = BELOW if is_below else ABOVE
        if is_below == (parting == BELOW):
            for entry in range(indptr[vertex], indptr[vertex + 1]):
                if (plane[indices[entry]] <= last) != is_below:
                    sides[vertex] = BETWEEN
                    break
    return sides


@numba.njit(cache=True, nogil=True)
def _beside_a_plane(coordinate, sizes, indptr, indices):  # type: ignore[no-untyped-def]
    """Sides (n,) of the best plane across an axis, and its cost; infinite without one.

    What parts the sides is all on one side of the plane.
    """
    plane, below, between = planes_across(coordinate, sizes, indptr, indices)
    lowest, best, parting = np.inf, 0, BELOW
    for number in range(len(below) - 1):
        under, over = below[number], below[-1] - below[number]
        for side in (BELOW, ABOVE):
            nodes = between[side, number]
            if side == BELOW:
                cost = _cost(nodes, under - nodes, over)
            else:
                cost = _cost(nodes, under, over - nodes)
            if cost < lowest:
                lowest, best, parting = cost, number, side
    return sides_of(plane, best, parting, indptr, indices), lowest


@numba.njit(cache=True, nogil=True)
def _improved(side, sizes, indptr, indices, cost):  # type: ignore[no-untyped-def]
    """Move vertices out of the separator of a cut as long as it gets cheaper; returns its cost."""
    count = len(side)
    nodes = np.zeros(3, dtype=np.int64)
    for vertex in range(count):
        nodes[side[vertex]] += sizes[vertex]
    between, place = np.empty(count, dtype=np.int64), np.full(count, -1)
    beside = np.zeros((count, 2), dtype=np.int64)
    moved, origin = np.empty(3 * count, dtype=np.int64), np.empty(3 * count, dtype=np.int8)
    for _ in range(ROUNDS):
        # Vertices between the sides, and how many nodes each has for neighbours on either.
        length = 0
        for vertex in range(count):
            if side[vertex] == BETWEEN:
                between[length], place[vertex] = vertex, length
                length += 1
                _count_beside(vertex, side, sizes, indptr, indices, beside)
        has_moved = np.zeros(count, dtype=np.bool_)
        before, moves, kept, waited = cost, 0, 0, 0
        while waited < PATIENCE:
            vertex, target = _best_move(between[:length], has_moved, sizes, beside, nodes)
            if vertex < 0:
                break
            other = 1 - target
            has_moved[vertex] = True
            moved[moves], origin[moves] = vertex, BETWEEN
            moves += 1
            side[vertex] = target
            nodes[BETWEEN] -= sizes[vertex]
            nodes[target] += sizes[vertex]
            length -= 1
            between[place[vertex]] = between[length]
            place[between[length]] = place[vertex]
            for entry in range(indptr[vertex], indptr[vertex + 1]):
                beside[indices[entry], target] += sizes[vertex]
            for entry in range(indptr[vertex], indptr[vertex + 1]):
                pulled = indices[entry]
                if side[pulled] != other:
                    continue
                moved[moves], origin[moves] = pulled, other
                moves += 1
                side[pulled] = BETWEEN
                nodes[other] -= sizes[pulled]
                nodes[BETWEEN] += sizes[pulled]
                between[length], place[pulled] = pulled, length
                length += 1
                _count_beside(pulled, side, sizes, indptr, indices, beside)
                for near in range(indptr[pulled], indptr[pulled + 1]):
                    beside[indices[near], other] -= sizes[pulled]
            now = _cost(nodes[BETWEEN], nodes[BELOW], nodes[ABOVE])
            waited += 1
            if now < cost:
                cost, kept, waited = now, moves, 0
        for move in range(moves - 1, kept - 1, -1):
            vertex = moved[move]
            nodes[side[vertex]] -= sizes[vertex]
            nodes[origin[move]] += sizes[vertex]
            side[vertex] = origin[move]
        if cost == before:
            break
    return cost


@numba.njit(cache=True, nogil=True)
def _count_beside(vertex, side, sizes, indptr, indices, beside):  # type: ignore[no-untyped-def]
    """Nodes that a vertex has for neighbours on either side."""
    beside[vertex] = 0
    for entry in range(indptr[vertex], indptr[vertex + 1]):
        if side[indices[entry]] != BETWEEN:
            beside[vertex, side[indices[entry]]] += sizes[indices[entry]]


@numba.njit(cache=True, nogil=True)
def _best_move(between, has_moved, sizes, beside, nodes):  # type: ignore[no-untyped-def]
    """The vertex between the sides whose move leaves the least cost, and the side it moves to.

    -1 if there is none.
    """
    lowest, best, side = np.inf, -1, BELOW
    for vertex in between:
        if has_moved[vertex]:
            continue
        for target in (BELOW, ABOVE):
            pulled = beside[vertex, 1 - target]
            cost = _cost(
                nodes[BETWEEN] - sizes[vertex] + pulled,
                nodes[target] + sizes[vertex],
                nodes[1 - target] - pulled,
            )
            if cost < lowest:
                lowest, best, side = cost, vertex, target
    return best, side
