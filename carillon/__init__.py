"""Carillon's common ground: what every room needs and no room owns.

Errors meant for the user, atomic HDF5 files, provenance, progress, and the check of the numerical
runtime (BLAS, threads).  Nothing in here knows any mathematics of the method.
"""

import os as _os

from carillon import openblas as _openblas
from carillon import step as _step

# Before anything loads numpy, and with it OpenBLAS, or MPI.
_openblas.configure(_os.environ)
_step.leave_lone_step(_os.environ)

__version__ = "0.1.0"
