"""Planes of a lattice that cut its nodes in two."""

import numba
import numpy as np

from carillon.arrays import Array, Index

SHORTEST_SIDE = 0.2
"""Least share of the nodes on either side of a cut, if there is such a cut."""


def lattice_of(positions: Array, origin: Array, edge: float) -> Index:
    """Integer coordinates (n, 3), in edges from the origin, of nodes at positions [m]."""
    return np.asarray(np.rint((positions - origin) / edge)).astype(np.int64)


@numba.njit(cache=True, nogil=True)
def best_plane(lattice, nodes, steps):  # type: ignore[no-untyped-def]
    """Axis and coordinate of the plane with few nodes that leaves two sides of similar size.

    Axis -1 if there is none.
    """
    best = (-1, 0)
    lowest = np.inf
    for axis in range(3):
        start = stop = lattice[nodes[0], axis]
        for node in nodes:
            start, stop = min(start, lattice[node, axis]), max(stop, lattice[node, axis])
        count = np.zeros(stop + 1 - start, dtype=np.int64)
        for node in nodes:
            count[lattice[node, axis] - start] += 1
        # The best of all planes, and of those with enough nodes on either side.
        costs, values = [np.inf, np.inf], [start, start]
        below = 0
        for plane in range(len(count)):
            above = len(nodes) - below - count[plane]
            smaller = min(below, above)
            if smaller > 0 and (start + plane) % steps == 0:
                cost = count[plane] / np.sqrt(below * above)
                for kind, least in enumerate((0.0, SHORTEST_SIDE * len(nodes))):
                    if smaller >= least and cost < costs[kind]:
                        costs[kind], values[kind] = cost, start + plane
            below += count[plane]
        kind = 1 if costs[1] < np.inf else 0
        if costs[kind] < lowest:
            lowest = costs[kind]
            best = (axis, values[kind])
    return best


@numba.njit(cache=True, nogil=True)
def divided(lattice, nodes, axis, value):  # type: ignore[no-untyped-def]
    """Nodes on a plane, below it and above it, in their order."""
    coordinate = lattice[nodes, axis]
    return nodes[coordinate == value], nodes[coordinate < value], nodes[coordinate > value]
