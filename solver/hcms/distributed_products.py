"""Products of tall matrices that several ranks share by rows."""

import numpy as np
from mpi4py import MPI

from carillon.arrays import Array
from solver.distribution.collective import Sent, receive_arrays, send_arrays
from solver.hcms.counts import Tally, product_flops

_ASKED, _ANSWERED = 23, 24
_PRODUCT, _TRANSPOSED = 0, 1


class Crew:
    """A rank and those that help it; they call `help_with_products` until it calls `dismiss`."""

    def __init__(self, comm: MPI.Comm, helpers: tuple[int, ...], tally: Tally) -> None:
        self.comm = comm
        self.helpers = helpers
        self.tally = tally

    def product(self, tall: Array, small: Array) -> Array:
        """Product of `tall` (r, k) and `small` (k, c); each rank multiplies some of the rows."""
        result = np.empty((len(tall), small.shape[1]))
        first, *others = row_slices(len(tall), 1 + len(self.helpers))
        small = np.ascontiguousarray(small)
        asked = [
            self._ask(rank, _PRODUCT, tall[rows], small)
            for rank, rows in zip(self.helpers, others, strict=True)
        ]
        result[first] = _product(_PRODUCT, tall[first], small, self.tally)
        for rank, rows in zip(self.helpers, others, strict=True):
            result[rows] = self._answer(rank)
        for messages in asked:
            messages.wait()
        return result

    def transposed_product(self, left: Array, right: Array) -> Array:
        """Product of the transpose of `left` (r, k) with `right` (r, c), summed over the ranks."""
        first, *others = row_slices(len(left), 1 + len(self.helpers))
        asked = [
            self._ask(rank, _TRANSPOSED, left[rows], right[rows])
            for rank, rows in zip(self.helpers, others, strict=True)
        ]
        result = _product(_TRANSPOSED, left[first], right[first], self.tally)
        for rank in self.helpers:
            result += self._answer(rank)
        for messages in asked:
            messages.wait()
        return result

    def dismiss(self) -> None:
        """Let the helpers go."""
        for rank in self.helpers:
            self.tally.sent(send_arrays(self.comm, [], rank, _ASKED)).wait()

    def _ask(self, rank: int, kind: int, first: Array, second: Array) -> Sent:
        arrays = [np.array([kind]), first, second]
        return self.tally.sent(send_arrays(self.comm, arrays, rank, _ASKED))

    def _answer(self, rank: int) -> Array:
        with self.tally.idle():
            (part,) = receive_arrays(self.comm, rank, _ANSWERED)
        return part


def help_with_products(comm: MPI.Comm, rank: int, tally: Tally) -> None:
    """Make the products that the crew of another `rank` asks for, until it is dismissed."""
    while True:
        with tally.idle():
            arrays = receive_arrays(comm, rank, _ASKED)
        if not arrays:
            return
        kind, first, second = arrays
        part = _product(int(kind[0]), first, second, tally)
        tally.sent(send_arrays(comm, [part], rank, _ANSWERED)).wait()


def row_slices(rows: int, ranks: int) -> list[slice]:
    """Even slices of so many rows, one for each rank.

    Examples
    --------
    >>> row_slices(7, 2)
    [slice(0, 3, None), slice(3, 7, None)]
    """
    bounds = [rows * rank // ranks for rank in range(ranks + 1)]
    return [slice(start, stop) for start, stop in zip(bounds[:-1], bounds[1:], strict=True)]


def _product(kind: int, first: Array, second: Array, tally: Tally) -> Array:
    rows, columns = first.shape
    tally.flops += product_flops(rows, columns, second.shape[1])
    return np.asarray(first @ second if kind == _PRODUCT else first.T @ second)
