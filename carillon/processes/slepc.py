"""SLEPc, loaded after PETSc, which then reads no settings from files; see `petsc`."""

import carillon.processes.petsc  # noqa: F401
from carillon.processes.present_folder import elsewhere

with elsewhere():
    from slepc4py import SLEPc

__all__ = ["SLEPc"]
