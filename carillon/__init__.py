"""Carillon's common ground: what every room needs and no room owns.

Errors meant for the user, commands and options, atomic HDF5 files, provenance, progress, the check
of the numerical runtime (BLAS, threads), and the finite element (`fem`), on which all else rests.
"""

import os as _os

from carillon.processes import kernel_cache as _kernel_cache
from carillon.processes import mpi_environment as _mpi_environment
from carillon.processes import openblas as _openblas
from carillon.processes import present_folder as _present_folder

# Before anything loads numpy, and with it OpenBLAS, or numba, or MPI.
_openblas.configure(_os.environ)
_present_folder.ignore_settings()
_kernel_cache.configure(_os.environ)
_mpi_environment.keep_off_networks()
_mpi_environment.leave_lonely_step(_os.environ)
_mpi_environment.start_without_daemon(_os.environ)
_mpi_environment.stay_apart(_os.environ, _os.getpid())

__version__ = "0.1.0"

ROOMS = ("carillon", "dataset_gen", "forests", "solver", "sound", "studio", "workflow", "studies")
"""Packages of the project; each imports those before it."""
