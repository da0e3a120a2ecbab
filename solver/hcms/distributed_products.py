"""Products of tall matrices that several ranks share by rows."""

from collections.abc import Sequence

import numpy as np

from carillon.arrays import Array
from carillon.processes.mpi import MPI
from solver.distribution.collective import AnyArray, Sent, receive_arrays, send_arrays
from solver.hcms.counts import Tally, product_flops

_ASKED, _ANSWERED = 23, 24
_PRODUCT, _TRANSPOSED = 0, 1

Factors = tuple[Array, Array]
"""Two matrices to be multiplied."""


class Crew:
    """A rank and those that help it; they call `help_with_products` until it calls `dismiss`."""

    def __init__(self, comm: MPI.Comm, helpers: tuple[int, ...], tally: Tally) -> None:
        self.comm = comm
        self.helpers = helpers
        self.tally = tally

    def products(self, factors: Sequence[Factors]) -> list[Array]:
        """Products of each `tall` (r, k) with `small` (k, c); each rank multiplies some rows."""
        parts = self._by_all(_PRODUCT, factors)
        return [np.concatenate(each) if len(each) > 1 else each[0] for each in zip(*parts)]

    def transposed_products(self, factors: Sequence[Factors]) -> list[Array]:
        """Products of the transpose of each `left` (r, k) with `right` (r, c), of all rows."""
        first, *others = self._by_all(_TRANSPOSED, factors)
        for part in others:
            for result, share in zip(first, part, strict=True):
                result += share
        return first

    def _by_all(self, kind: int, factors: Sequence[Factors]) -> list[list[Array]]:
        """Products of the rows of this rank and of each helper, with one message each way."""
        if not factors:
            return [[]]
        cuts = [row_slices(len(first), 1 + len(self.helpers)) for first, _ in factors]
        own, *others = [
            [
                (first[rows], second if kind == _PRODUCT else second[rows])
                for (first, second), rows in zip(factors, slices, strict=True)
            ]
            for slices in zip(*cuts, strict=True)
        ]
        asked = [
            self._send(rank, [np.array([kind]), *(each for pair in share for each in pair)])
            for rank, share in zip(self.helpers, others, strict=True)
        ]
        parts = [_products(kind, own, self.tally)]
        for rank in self.helpers:
            with self.tally.idle():
                parts.append(receive_arrays(self.comm, rank, _ANSWERED))
        for message in asked:
            message.wait()
        return parts

    def dismiss(self) -> None:
        """Let the helpers go."""
        for rank in self.helpers:
            self._send(rank, []).wait()

    def _send(self, rank: int, arrays: list[AnyArray]) -> Sent:
        return self.tally.sent(send_arrays(self.comm, arrays, rank, _ASKED))


def help_with_products(comm: MPI.Comm, rank: int, tally: Tally) -> None:
    """Make the products that the crew of another `rank` asks for, until it is dismissed."""
    while True:
        with tally.idle():
            arrays = receive_arrays(comm, rank, _ASKED)
        if not arrays:
            return
        kind, *shares = arrays
        parts = _products(int(kind[0]), list(zip(shares[::2], shares[1::2], strict=True)), tally)
        tally.sent(send_arrays(comm, parts, rank, _ANSWERED)).wait()


def row_slices(rows: int, ranks: int) -> list[slice]:
    """Even slices of so many rows, one for each rank.

    Examples
    --------
    >>> row_slices(7, 2)
    [slice(0, 3, None), slice(3, 7, None)]
    """
    bounds = [rows * rank // ranks for rank in range(ranks + 1)]
    return [slice(start, stop) for start, stop in zip(bounds[:-1], bounds[1:], strict=True)]


def _products(kind: int, factors: Sequence[Factors], tally: Tally) -> list[Array]:
    for first, second in factors:
        tally.flops += product_flops(first.shape[0], first.shape[1], second.shape[1])
    return [first @ second if kind == _PRODUCT else first.T @ second for first, second in factors]
