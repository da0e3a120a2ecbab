"""`carillon modes` on ranks of which one fails at the beginning of a phase (test support).

`python -m mpi4py tests/failing_ranks.py HOW RANK PHASE ARGUMENTS...`: HOW is `killed`, for SIGKILL,
or `raises`, for an error that the other ranks know nothing of.
"""

import os
import signal
import sys

from mpi4py import MPI

from carillon.errors import UserError
from solver.__main__ import main
from solver.analysis.phases import RankClock

SENTENCE = "one rank alone has failed"


def fail_at(phase: str, rank: int, how: str) -> None:
    """Have a rank fail when the clock is told of a phase."""
    begin = RankClock.__call__

    def failing(clock, name):
        if name == phase and MPI.COMM_WORLD.rank == rank:
            if how == "killed":
                os.kill(os.getpid(), signal.SIGKILL)
            raise UserError(SENTENCE)
        return begin(clock, name)

    RankClock.__call__ = failing  # type: ignore[method-assign]


if __name__ == "__main__":
    how, rank, phase, *words = sys.argv[1:]
    fail_at(phase, int(rank), how)
    sys.exit(main(["modes", *words]))
