"""Elimination of the fronts of a multifrontal factorisation, children before parents."""

from pathlib import Path
from typing import Any

import numpy as np
import scipy.linalg as la

from carillon.arrays import Array
from carillon.errors import LocalConvergenceError
from carillon.numerics.simd import compiler
from carillon.processes.threads import in_parallel, split
from solver.linear import panels
from solver.linear.panels import PANEL, STRIP, packed_size, panels_of
from solver.linear.plan import Plan

compiled = compiler(Path(__file__), Path(panels.__file__))


def eliminate_fronts(
    plan: Plan,
    stiffness: Array,
    mass: Array,
    shift: float,
    threads: int,
    kept: tuple[Array, Array, Array] | None,
    dtype: Any = np.float64,
) -> tuple[int, Array]:
    """Eliminate the rows of K - shift M that the plan eliminates.

    Returns how many eigenvalues of the pivots are negative, and the matrix that is left of the
    nodes that the plan keeps, packed as updates are. Raises LocalConvergenceError if the shift is
    an eigenvalue to rounding.

    Parameters
    ----------
    plan, stiffness, mass, shift, threads
        See `solver.linear.multifrontal.Factor`.
    kept
        What a solve needs goes there: pivots with what couples panels, W in strips, and signs.
    dtype
        Precision that the fronts are eliminated in, and kept in.
    """
    updates: dict[int, Array] = {}
    own_rows, outside = plan.own_rows, plan.outside_rows
    last = len(own_rows) - 1

    def eliminated(front: int, room: Array, threads: int = 1) -> int:
        n, b = int(own_rows[front]), int(outside[front])
        own = room[: n * (n + b)].reshape(n, n + b)
        # A piece that nothing connects to the rest has no update.
        children = [child for child in plan.children[front] if child in updates]

        def assemble(first: int, stop: int) -> None:
            own[3 * first : 3 * stop] = 0.0
            _add_entries(own, first, stop, plan.entries[front], stiffness, mass, shift)
            for child in children:
                _subtract_from_own(own, first, stop, plan.places[child], updates[child])

        def update_strip(first: int) -> None:
            _update_strip(own, signs, coupling, update, first)
            for child in children:
                _add_beyond(update, b, first // 3, n // 3, plan.places[child], updates[child])

        in_parallel(assemble, split(n // 3, threads, max(n, 1)), threads)
        pivots = coupling = None
        if kept is not None:
            pivots = kept[0][plan.pivot_offset[front] : plan.pivot_offset[front + 1]]
            coupling = kept[1][plan.coupling_offset[front] : plan.coupling_offset[front + 1]]
        signs = _eliminate_panels(own, pivots, threads)
        if kept is not None:
            kept[2][plan.sign_offset[front] : plan.sign_offset[front + 1]] = signs
        if b:
            update = np.empty(packed_size(b), dtype)
            in_parallel(update_strip, [(first,) for first in range(0, b, STRIP)], threads)
            if front == last and plan.kept:
                _subtract_entries(update, b, plan.kept_entries, stiffness, mass, shift)
            updates[front] = update
        for child in children:
            del updates[child]
        return int((signs < 0.0).sum())

    def eliminated_part(first: int, stop: int, threads: int = 1) -> int:
        largest = (own_rows[first:stop] * (own_rows + outside)[first:stop]).max()
        room = np.empty(int(largest), dtype)
        return sum(eliminated(front, room, threads) for front in range(first, stop))

    # The fronts above the branches are few and large: threads share each of them.
    shares = plan.shares(threads)
    branches = [shares.ranges[number] for number in shares.branches]
    negative = sum(in_parallel(eliminated_part, branches, threads))
    for part, shared in zip(shares.ranges, shares.shared, strict=True):
        if shared:
            negative += eliminated_part(*part, threads)
    rest = updates.pop(last).astype(float, copy=False) if plan.kept else np.empty(0)
    np.negative(rest, out=rest)
    return negative, rest


def _eliminate_panels(own: Array, pivots: Array | None, threads: int) -> Array:
    """Eliminate the own rows of a front, a panel of them at a time.

    Returns the signs (n,) of the eigenvalues of the diagonal blocks.

    Parameters
    ----------
    own
        (n, n + b) own rows of the matrix, of which the upper triangle counts; on return those of
        the matrix from which the panels before were eliminated, times the roots X of `roots_of`.
    pivots
        What becomes of each panel's own columns: the root of the inverse of its diagonal block, and
        what couples the panel to the panels after, times it and the signs.
    threads
        They share the columns beyond.
    """
    n = len(own)
    panels, signs = panels_of(n), np.empty(n, own.dtype)
    roots: list[Array] = []
    place = 0

    def take_off(start: int, stop: int, first: int, last: int) -> None:
        turned = signs[:start, None] * own[:start, start:stop]
        own[start:stop, first:last] -= turned.T @ own[:start, first:last]

    def take_off_beyond(first: int, last: int) -> None:
        for (start, stop), root in zip(panels, roots, strict=True):
            if start:
                take_off(start, stop, n + first, n + last)
            own[start:stop, n + first : n + last] = root @ own[start:stop, n + first : n + last]

    for start, stop in panels:
        if start:
            take_off(start, stop, start, n)
        root, signs[start:stop] = roots_of(own[start:stop, start:stop])
        roots.append(root)
        own[start:stop, stop:n] = root @ own[start:stop, stop:n]
        if pivots is None:
            continue
        for part in (root, signs[start:stop, None] * own[start:stop, stop:n]):
            pivots[place : place + part.size].reshape(part.shape)[:] = part
            place += part.size
    beyond = own.shape[1] - n
    if beyond:
        in_parallel(take_off_beyond, split(beyond, threads, own.shape[1]), threads)
    return signs


def roots_of(block: Array) -> tuple[Array, Array]:
    """X (n, n) and signs s (n,) of a symmetric matrix A, given its upper triangle.

    A^-1 = X^T diag(s) X. Products with X, and then X^T, keep digits where A is badly conditioned,
    as that of a thin wall in a cell is: their errors are of the size of the condition's root, and
    along motions that hardly have energy. Those with A^-1 would be of the size of the condition,
    anywhere (Higham 2002, section 14).
    """
    scale = np.sqrt(np.abs(np.diag(block)))
    scale[scale == 0.0] = 1.0
    scaled = block / scale / scale[:, None]
    potrf, trtri = la.get_lapack_funcs(("potrf", "trtri"), (scaled,))
    # The upper triangle of a row-major matrix is the lower one of a column-major one.
    lower, failed = potrf(scaled.T, lower=1, clean=1)
    if not failed:
        root, failed = trtri(lower, lower=1)
    if not failed:
        return np.ascontiguousarray(root / scale), np.ones(len(block), block.dtype)
    values, vectors = la.eigh(scaled.T, lower=True, check_finite=False)
    size = np.abs(values)
    if not size.min() > np.finfo(block.dtype).tiny:
        raise LocalConvergenceError("the shifted matrix is singular to rounding; change the shift")
    root = vectors.T / np.sqrt(size)[:, None] / scale
    return np.ascontiguousarray(root), np.sign(values)


def _update_strip(
    own: Array, signs: Array, coupling: Array | None, update: Array, first: int
) -> None:
    """Fill a strip of a front's update: what eliminating its own rows takes off the rows beyond.

    Parameters
    ----------
    own, signs
        Of `_eliminate_panels`.
    coupling
        The own rows' columns beyond, times the signs, become this, a strip of columns after the
        other.
    update
        Upper triangle of a symmetric matrix: strips of rows, each a rectangle that begins at its
        first diagonal entry, what is left of the diagonal being anything.
    first
        Row beyond that the strip begins with.
    """
    n = len(own)
    beyond = own[:, n:]
    b = beyond.shape[1]
    last = min(first + STRIP, b)
    if coupling is None:
        turned = np.empty((n, last - first), own.dtype)
    else:
        turned = coupling[n * first : n * last].reshape(n, last - first)
    np.multiply(signs[:, None], beyond[:, first:last], out=turned)
    place = packed_size(b) - packed_size(b - first)
    size = (last - first) * (b - first)
    rows = update[place : place + size].reshape(last - first, b - first)
    for start, stop in split(last - first, 1, PANEL):
        np.matmul(turned[:, start:stop].T, beyond[:, first + start :], out=rows[start:stop, start:])


@compiled
def _add_entries(matrix, first, stop, entries, stiffness, mass, shift):  # type: ignore[no-untyped-def]
    """Entries of the rows of the nodes from `first` to `stop`."""
    for entry in range(np.searchsorted(entries[:, 0], first), entries.shape[0]):
        if entries[entry, 0] >= stop:
            break
        row, column, number = 3 * entries[entry, 0], 3 * entries[entry, 1], entries[entry, 2]
        for i in range(3):
            for j in range(3):
                matrix[row + i, column + j] += stiffness[number, i, j]
            matrix[row + i, column + i] -= shift * mass[number]


@compiled
def _subtract_entries(packed, size, entries, stiffness, mass, shift):  # type: ignore[no-untyped-def]
    for entry in range(entries.shape[0]):
        row, column, number = 3 * entries[entry, 0], 3 * entries[entry, 1], entries[entry, 2]
        for i in range(3):
            target, first = _row(packed, size, row + i)
            for j in range(3):
                target[column + j - first] -= stiffness[number, i, j]
            target[column + i - first] += shift * mass[number]


@compiled
def _row(packed, size, row):  # type: ignore[no-untyped-def]
    """A row of a packed matrix, from the first column of its strip on, which is returned too."""
    first = row // STRIP * STRIP
    place = first * size - first * (first - STRIP) // 2 + (row - first) * (size - first)
    return packed[place : place + size - first], first


@compiled
def _subtract_from_own(own, first, stop, places, update):  # type: ignore[no-untyped-def]
    """Subtract a child's update from the own rows of the nodes from `first` to `stop`."""
    size = 3 * len(places)
    for a in range(np.searchsorted(places, first), np.searchsorted(places, stop)):
        for i in range(3):
            target = own[3 * places[a] + i]
            source, start = _row(update, size, 3 * a + i)
            for b in range(a, len(places)):
                for j in range(3):
                    target[3 * places[b] + j] -= source[3 * b + j - start]


@compiled
def _add_beyond(total, total_size, first, count, places, update):  # type: ignore[no-untyped-def]
    """Add a child's update to the strip of rows beyond that begins with the node `first`."""
    size, stop = 3 * len(places), count + first + STRIP // 3
    for a in range(np.searchsorted(places, count + first), np.searchsorted(places, stop)):
        for i in range(3):
            target, start = _row(total, total_size, 3 * (places[a] - count) + i)
            source, begin = _row(update, size, 3 * a + i)
            for b in range(a, len(places)):
                for j in range(3):
                    target[3 * (places[b] - count) + j - start] += source[3 * b + j - begin]
