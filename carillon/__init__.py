"""`import carillon as ca`: modes of solids and sounds from them, by the names of `carillon.api`.

Beside these, the packages in here are the common ground of all rooms: commands and options, files,
provenance, processes with their threads and ranks, and the finite element (`fem`).
"""

# ruff: noqa: F403, F405
import os as _os
import sys as _sys
from typing import TYPE_CHECKING

from carillon import lazy_exports as _lazy_exports
from carillon.processes import kernel_cache as _kernel_cache
from carillon.processes import mpi_environment as _mpi_environment
from carillon.processes import present_folder as _present_folder
from carillon.processes import rooms as _rooms

if TYPE_CHECKING:
    from carillon.api import *
    from carillon.errors import ConvergenceError, UserError

# Before anything loads numpy, and with it OpenBLAS, or numba, or MPI.
_rooms.find(_sys.path)
# numpy, scipy and PETSc have a copy of OpenBLAS each. An idle thread of one copy spins for 2^26
# cycles beside those of the others, which halves the speed of code that calls them in turn; with
# this value, unless the user has set one, it goes to sleep at once.
_os.environ.setdefault("OPENBLAS_THREAD_TIMEOUT", "4")
_present_folder.ignore_settings()
_kernel_cache.configure(_os.environ)
_mpi_environment.keep_off_networks()
_mpi_environment.leave_lonely_step(_os.environ)
_mpi_environment.start_without_daemon(_os.environ)
_mpi_environment.stay_apart(_os.environ, _os.getpid())

__version__ = "0.2.0"

ROOMS = ("carillon", "dataset_gen", "forests", "solver", "sound", "studio", "workflow", "studies")
"""Packages of the project; each imports those before it."""

_ERRORS = ("ConvergenceError", "UserError")
__all__ = [
    "ConvergenceError",
    "Design",
    "Forests",
    "Material",
    "Mesh",
    "Region",
    "Solution",
    "Sound",
    "Support",
    "UserError",
    "audit",
    "coarsen",
    "compare",
    "design",
    "estimate",
    "extract",
    "generate",
    "load_mesh",
    "matrices",
    "read",
    "render",
    "solve",
    "train",
    "write_wav",
]

__getattr__ = _lazy_exports.exports(
    __name__, {name: "errors" if name in _ERRORS else "api" for name in __all__}
)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
