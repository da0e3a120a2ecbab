"""`MPI` as mpi4py has it, or that of one rank where mpi4py is not installed.

mpi4py needs an MPI library, which few machines of one person have, and nothing on one machine needs
either: `carillon.processes.one_rank` does there.  Whoever was started as one of several ranks is
told what is missing, since every one of them would do all the work and write the same files.
"""

import os
from typing import TYPE_CHECKING

from carillon.errors import UserError, on_all_ranks, one_line
from carillon.processes import extras
from carillon.processes.mpi_environment import started_ranks

__all__ = ["MPI"]

if TYPE_CHECKING:
    from mpi4py import MPI
elif extras.is_installed(extras.MPI):
    try:
        from mpi4py import MPI
    except (ImportError, RuntimeError) as error:  # RuntimeError: its wheel finds no library
        raise UserError(
            f"mpi4py is installed and cannot be loaded ({one_line(str(error))}); install the MPI "
            "that it was built for, or remove mpi4py, without which Carillon runs on one rank"
        ) from None
else:
    ranks = started_ranks(os.environ)
    if ranks > 1:
        with on_all_ranks():
            extras.require(
                extras.MPI,
                f"a run on {ranks} ranks",
                "start one process, without mpiexec",
            )
    from carillon.processes import one_rank as MPI  # noqa: N812
