"""The MPI ranks of this job, for programs that do without MPI if there is one rank alone."""

import os
import sys
from typing import Any

from carillon.errors import UserError

Comm = Any
"""mpi4py's communicator; mpi4py is imported only where a launcher started several ranks."""

_LAUNCHERS = ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "MPI_LOCALNRANKS")


def world() -> Comm | None:
    """All ranks of this job; None unless it has several.

    Raises UserError if a launcher started several ranks and there is no mpi4py.
    """
    launched = any(os.environ.get(name, "1") != "1" for name in _LAUNCHERS)
    if not launched and "mpi4py" not in sys.modules:
        return None
    try:
        from mpi4py import MPI
    except ImportError as error:
        raise UserError(
            f"started as one of several ranks, but {error}; install mpi4py, or start one process "
            "with --workers"
        ) from None
    return MPI.COMM_WORLD if MPI.COMM_WORLD.size > 1 else None
