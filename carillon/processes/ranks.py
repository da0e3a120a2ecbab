"""The MPI ranks of this job, for programs that do without MPI if there is one rank alone."""

import os
import sys
from typing import Any

from carillon.processes.mpi_environment import started_ranks

Comm = Any
"""mpi4py's communicator; mpi4py is imported only where a launcher started several ranks."""


def world() -> Comm | None:
    """All ranks of this job; None unless it has several.

    Raises UserError if a launcher started several ranks and there is no mpi4py.
    """
    if started_ranks(os.environ) == 1 and "mpi4py" not in sys.modules:
        return None
    from carillon.processes.mpi import MPI

    return MPI.COMM_WORLD if MPI.COMM_WORLD.size > 1 else None
