"""What the synthesis does, phase by phase: messages, bytes, floating-point operations, seconds.

Operations are counted by formulae where they are started, not measured; they feed a model of how
the synthesis scales.  Phases are `local` (modes of the subdomains), `merge 1`, `merge 2`, ... (by
level of the merge tree), `down` (coefficients on their way back) and `basis` (the final vectors).
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import astuple, dataclass, fields

import numpy as np

from carillon.arrays import Array
from carillon.processes.mpi import MPI
from solver.distribution.collective import Sent
from solver.hcms.lowest import BLOCK_FRACTION, STEPS

SHARED_COST = 1.8
"""Time of an operation of ScaLAPACK on two ranks over one of LAPACK, for orders of 450 to 800."""
SENT_A_COLUMN = 4
"""Vectors that a rank sends on for every column that ScaLAPACK reduces."""


@dataclass
class Tally:
    """One rank's part in one phase."""

    messages: float = 0.0
    bytes: float = 0.0
    """Messages sent by this rank and the bytes in them."""
    flops: float = 0.0
    """Floating-point operations of the dense and sparse algebra, estimated."""
    seconds: float = 0.0
    """Wall time, waiting included."""
    waiting: float = 0.0
    """Wall time [s] spent waiting for messages."""

    def sent(self, sent: Sent) -> Sent:
        """Add a message under way; returns it."""
        self.messages += 1
        self.bytes += sent.bytes
        return sent

    @contextmanager
    def running(self) -> Iterator[None]:
        """Add the wall time of the body."""
        begin = time.perf_counter()
        yield
        self.seconds += time.perf_counter() - begin

    @contextmanager
    def idle(self) -> Iterator[None]:
        """Add the wall time of the body, which waits for a message."""
        begin = time.perf_counter()
        yield
        self.waiting += time.perf_counter() - begin


class Counts:
    """Tallies of one rank, by phase; the phases are the same on every rank.

    Attributes
    ----------
    merges
        Tally of each level of the merge tree, from the subdomains up.
    """

    def __init__(self, levels: int) -> None:
        self.local = Tally()
        self.merges = [Tally() for _ in range(levels)]
        self.down = Tally()
        self.basis = Tally()

    def phases(self) -> dict[str, Tally]:
        """Tallies by name, in the order of the work."""
        merges = {f"merge {level}": tally for level, tally in enumerate(self.merges, start=1)}
        return {"local": self.local, **merges, "down": self.down, "basis": self.basis}

    def per_rank(self, comm: MPI.Comm) -> dict[str, dict[str, Array]]:
        """Every phase's quantities as arrays (ranks,), the same on every rank; collective."""
        phases = self.phases()
        mine = np.array([astuple(tally) for tally in phases.values()])
        everyone = np.empty((comm.size, *mine.shape))
        comm.Allgather(mine, everyone)
        names = [field.name for field in fields(Tally)]
        return {
            phase: {name: everyone[:, row, column] for column, name in enumerate(names)}
            for row, phase in enumerate(phases)
        }

    def summary(self, comm: MPI.Comm) -> dict[str, dict[str, float]]:
        """Every phase's sums over the ranks, and the largest of one rank as `..._max`; collective.

        Times are the slowest rank's; `busy` [s] is the longest that a rank did not wait.
        """
        summary = {}
        for phase, tallies in self.per_rank(comm).items():
            summary[phase] = {
                **{name: float(tallies[name].sum()) for name in ("messages", "bytes", "flops")},
                **{f"{name}_max": float(tallies[name].max()) for name in ("bytes", "flops")},
                "seconds": float(tallies["seconds"].max()),
                "busy": float((tallies["seconds"] - tallies["waiting"]).max()),
            }
        return summary


def product_flops(rows: int, inner: int, columns: int) -> float:
    """Product of dense matrices (rows, inner) and (inner, columns).

    Examples
    --------
    >>> product_flops(10, 20, 30)
    12000.0
    """
    return 2.0 * rows * inner * columns


def sparse_product_flops(entries: int, columns: int) -> float:
    """Product of a sparse matrix of so many `entries` with `columns` dense columns."""
    return 2.0 * entries * columns


def eigen_flops(size: int, generalised: bool) -> float:
    """All eigenpairs of a dense symmetric matrix, or pencil, by divide and conquer.

    Tridiagonalisation and divide and conquer take 4/3 n^3 each, transforming back 2 n^3; a pencil
    adds Cholesky (1/3), the reduction to standard form (1) and the vectors' (1).
    """
    return (14.0 / 3.0 + (7.0 / 3.0 if generalised else 0.0)) * float(size) ** 3


def count_shared_eigenproblem(tally: Tally, size: int, generalised: bool, ranks: int) -> None:
    """Add one rank's part of the same, shared by several in ScaLAPACK: an estimate.

    Operations are those that LAPACK would do in the time, see `SHARED_COST`.  For every column, the
    tridiagonalisation sends parts of vectors `SENT_A_COLUMN` times along the grid of ranks.
    """
    side = np.sqrt(ranks)
    sent = SENT_A_COLUMN * np.ceil(np.log2(side))
    tally.flops += SHARED_COST * eigen_flops(size, generalised) / ranks
    tally.messages += sent * size
    tally.bytes += 8.0 * sent * size**2 / side


def krylov_flops(size: int, modes: int, steps: int = STEPS) -> float:
    """Lowest `modes` of a compact solid of `size` unknowns, see `solver.hcms.lowest`.

    Nested dissection of a cube of N nodes has a separator of s = 3 N^(2/3) unknowns at the top;
    summed over the levels, the factorisation by dense products takes about 4 s^3 and the factor has
    about 2 s^2 entries.  Every vector takes a solve and its part in four products of the basis with
    itself or coefficients; the reduced problem is dense.
    """
    separator = 3.0 * (size / 3.0) ** (2.0 / 3.0)
    vectors = min((1 + steps) * BLOCK_FRACTION * modes, float(size))
    solves = 8.0 * separator**2 * vectors
    products = 8.0 * size * vectors**2
    return 4.0 * separator**3 + solves + products + 2.0 * eigen_flops(int(vectors), False)
