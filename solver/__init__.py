"""Modal analysis of voxel solids, from the mesh file to the modes file."""

from typing import TYPE_CHECKING, Any

import carillon

if TYPE_CHECKING:
    from solver.analysis.library import Solution, solve

__all__ = ["Solution", "solve"]


def __getattr__(name: str) -> Any:
    """`solve` and `Solution`, loaded when first asked for: they bring PETSc with them."""
    if name in __all__:
        from solver.analysis import library

        return getattr(library, name)
    raise AttributeError(f"module 'solver' has no attribute {name!r}")
