"""SLEPc, loaded after PETSc, which reads no settings from files then; see `carillon.petsc`."""

from __future__ import annotations

import carillon.petsc  # noqa: F401

from slepc4py import SLEPc  # isort: skip

__all__ = ["SLEPc"]
