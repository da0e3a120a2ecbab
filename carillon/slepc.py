"""SLEPc, loaded after PETSc, which reads no settings from files then; see `carillon.petsc`."""

from __future__ import annotations

import carillon.petsc  # noqa: F401
from carillon.present_folder import elsewhere

with elsewhere():
    from slepc4py import SLEPc

__all__ = ["SLEPc"]
