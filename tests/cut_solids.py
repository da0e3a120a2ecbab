"""Solids that stand askew in their lattice (test support)."""

import numpy as np
import trimesh
from numpy.typing import NDArray
from trimesh.transformations import euler_matrix

from carillon.fem.finite_cells.build import finite_cells
from carillon.fem.finite_cells.cells import FiniteCells
from carillon.fem.finite_cells.model import FiniteCellModel, finite_cell_model
from carillon.fem.regions import Regions
from solver.analysis.modal_solver import modal_analysis
from solver.analysis.options import SolverOptions
from studies.accuracy.solids import ANGLES, DENSITY, POISSON, YOUNG


def box(*sides: float, at: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> trimesh.Trimesh:
    """A box about the origin, or about another point."""
    return trimesh.creation.box(extents=sides).apply_translation(at)


def turned(surface: trimesh.Trimesh) -> trimesh.Trimesh:
    """The surface turned by `ANGLES`."""
    return surface.copy().apply_transform(euler_matrix(*np.radians(ANGLES)))


def spaced(surface: trimesh.Trimesh, spacing: float) -> FiniteCells:
    """Finite cells with about this spacing."""
    return finite_cells(surface, round(float(np.ptp(surface.bounds, axis=0).max()) / spacing))


def uniform(cells: FiniteCells) -> FiniteCellModel:
    """Of one modulus."""
    return finite_cell_model(
        cells, np.full(cells.mesh.n_cells, YOUNG), Regions.one(POISSON, DENSITY)
    )


def eigenvalues(model: FiniteCellModel, count: int) -> NDArray[np.float64]:
    """The lowest ones by SLEPc."""
    return modal_analysis(model, SolverOptions(modes=count, method="slepc")).values
