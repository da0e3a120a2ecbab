"""Solids that stand askew in their lattice (test support)."""

import numpy as np
import trimesh
from numpy.typing import NDArray
from trimesh.transformations import euler_matrix

from carillon.fem.element import CORNERS
from carillon.fem.finite_cells.build import finite_cells
from carillon.fem.finite_cells.cells import FiniteCells
from carillon.fem.finite_cells.covering import Covering
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


def divided(cover: Covering, shares: tuple[float, ...], seed: int = 1) -> FiniteCells:
    """Cells of which a share of each level is divided, one at least, chosen at random."""
    rng = np.random.default_rng(seed)
    cells = cover.cells
    places = np.unique(cells.corner // cells.span[:, None], axis=0).astype(np.int64)
    chosen = []
    for share in shares:
        some = rng.random(len(places)) < share
        some[rng.integers(len(places))] = True
        chosen.append(places[some])
        places = (2 * chosen[-1][:, None] + CORNERS).reshape(-1, 3)
    return cover.divided(chosen)
