"""Symbolic factorisation: which rows every front is coupled to, and where entries go in it."""

import numba
import numpy as np

_ROOM = 1 << 16


@numba.njit(cache=True, nogil=True)
def boundaries(indptr, indices, order, position, first, parent):  # type: ignore[no-untyped-def]
    """Positions that each front is coupled to, after its own, in compressed form.

    Returns offsets (fronts + 1,) and positions, ascending in each front.

    Parameters
    ----------
    indptr, indices
        Graph of the nodes in compressed rows.
    order, position
        Nodes in the order of elimination, and the place of each in it.
    first, parent
        See `solver.linear.dissection.Fronts`.
    """
    fronts = len(parent)
    offset = np.zeros(fronts + 1, dtype=np.int64)
    boundary = np.empty(_ROOM, dtype=np.int64)
    reached = np.full(len(order), -1, dtype=np.int64)
    last, before = _children(parent)
    end = 0
    for front in range(fronts):
        stop = first[front + 1]
        for place in range(first[front], stop):
            node = order[place]
            if end + indptr[node + 1] - indptr[node] > len(boundary):
                boundary = _grown(boundary, end + indptr[node + 1] - indptr[node])
            for entry in range(indptr[node], indptr[node + 1]):
                other = position[indices[entry]]
                if other >= stop and reached[other] != front:
                    reached[other] = front
                    boundary[end] = other
                    end += 1
        child = last[front]
        while child >= 0:
            if end + offset[child + 1] - offset[child] > len(boundary):
                boundary = _grown(boundary, end + offset[child + 1] - offset[child])
            for number in range(offset[child], offset[child + 1]):
                other = boundary[number]
                if other >= stop and reached[other] != front:
                    reached[other] = front
                    boundary[end] = other
                    end += 1
            child = before[child]
        boundary[offset[front] : end].sort()
        offset[front + 1] = end
    return offset, boundary[:end].copy()


@numba.njit(cache=True, nogil=True)
def _grown(values, least):  # type: ignore[no-untyped-def]
    more = np.empty(max(2 * len(values), least), dtype=values.dtype)
    more[: len(values)] = values
    return more


@numba.njit(cache=True, nogil=True)
def entries(indptr, indices, order, position, first, offset, boundary):  # type: ignore[no-untyped-def]
    """Block entries of each front in compressed form.

    Those with a row of the front and a column that is not eliminated before it.  `offset` and
    `boundary` are those of `boundaries`. Returns offsets (fronts + 1,), and (e, 3) int32: row and
    column in the front, number in the data.
    """
    fronts = len(first) - 1
    start = np.zeros(fronts + 1, dtype=np.int64)
    for front in range(fronts):
        start[front + 1] = start[front]
        for place in range(first[front], first[front + 1]):
            node = order[place]
            for number in range(indptr[node], indptr[node + 1]):
                if position[indices[number]] >= first[front]:
                    start[front + 1] += 1
    result = np.empty((start[-1], 3), dtype=np.int32)
    local = np.empty(len(order), dtype=np.int64)
    end = 0
    for front in range(fronts):
        _number_rows(front, first, offset, boundary, local)
        for place in range(first[front], first[front + 1]):
            node = order[place]
            for number in range(indptr[node], indptr[node + 1]):
                other = position[indices[number]]
                if other >= first[front]:
                    result[end, 0] = place - first[front]
                    result[end, 1] = local[other]
                    result[end, 2] = number
                    end += 1
    return start, result


@numba.njit(cache=True, nogil=True)
def places(size, first, parent, offset, boundary):  # type: ignore[no-untyped-def]
    """Place of each front's `boundary` in its parent's front; in the whole order without one.

    The order has `size` nodes.
    """
    result = boundary.copy()
    local = np.empty(size, dtype=np.int64)
    last, before = _children(parent)
    for front in range(len(parent)):
        if last[front] < 0:
            continue
        _number_rows(front, first, offset, boundary, local)
        child = last[front]
        while child >= 0:
            for number in range(offset[child], offset[child + 1]):
                result[number] = local[boundary[number]]
            child = before[child]
    return result


@numba.njit(cache=True, nogil=True)
def _children(parent):  # type: ignore[no-untyped-def]
    """The last child of each front, and the one before each; -1 for none."""
    last, before = np.full(len(parent), -1), np.full(len(parent), -1)
    for front in range(len(parent)):
        if parent[front] >= 0:
            before[front] = last[parent[front]]
            last[parent[front]] = front
    return last, before


@numba.njit(cache=True, nogil=True)
def _number_rows(front, first, offset, boundary, local):  # type: ignore[no-untyped-def]
    """Write the place in the front of each position that belongs to it to `local`."""
    for place in range(first[front], first[front + 1]):
        local[place] = place - first[front]
    for number in range(offset[front], offset[front + 1]):
        local[boundary[number]] = first[front + 1] - first[front] + number - offset[front]
