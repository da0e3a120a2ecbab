"""Spectra of a solid by both discretisations, with what they take."""

import time
from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array, Surface
from carillon.fem.finite_cells.model import FiniteCellModel, finite_cell_model
from carillon.fem.model import Solid, fine_model
from carillon.fem.regions import Regions
from carillon.processes.mpi import MPI
from solver.accuracy.estimate import estimate_cell_errors
from solver.analysis.modal_solver import modal_analysis
from solver.analysis.options import SolverOptions
from solver.analysis.problem import DISCRETISATIONS, ProblemOptions, discretised
from solver.analysis.solid_surface import SolidSurface
from studies.accuracy.solids import DENSITY, POISSON, YOUNG


@dataclass(frozen=True)
class Spectrum:
    """Eigenvalues (k,) [rad^2/s^2], rigid motions first, and what they took."""

    values: Array
    spacing: float
    """Between neighbouring nodes [m]; of tetrahedra as it was asked for."""
    unknowns: int
    """Of the model."""
    build_seconds: float
    solve_seconds: float
    """Wall time from the surface to the mesh, and from there to the eigenvalues."""
    expected: float | None = None
    """Root mean square error that finite cells expect of themselves."""


def cells(surface: Surface, name: str, spacing: float, kind: str, modes: int) -> Spectrum:
    """Lowest eigenvalues by a discretisation on a lattice of about this spacing [m].

    Raises UserError if the solid falls apart in such a lattice.
    """
    assert kind in DISCRETISATIONS
    longest = float(np.ptp(surface.bounds, axis=0).max())
    resolution = max(2, round(longest / spacing))
    begin = time.perf_counter()
    model = _model(surface, ProblemOptions(name, resolution, discretisation=kind))
    built = time.perf_counter()
    solved = modal_analysis(model, SolverOptions(modes=modes), MPI.COMM_SELF)
    seconds = time.perf_counter() - built
    expected = None
    if isinstance(model, FiniteCellModel):
        vectors = solved.system.gather(solved.vectors)
        assert vectors is not None
        expected = estimate_cell_errors(model, solved.values, vectors).errors.rms
    solved.destroy()
    spacing = longest / resolution
    return Spectrum(solved.values, spacing, model.n_dofs, built - begin, seconds, expected)


def _model(surface: Surface, options: ProblemOptions) -> Solid:
    mesh, cells = discretised(SolidSurface(options.mesh, surface), options)
    young = np.full(mesh.n_cells, YOUNG)
    if cells is None:
        return fine_model(mesh, young, regions=Regions.one(POISSON, DENSITY))
    return finite_cell_model(cells.cells, young, Regions.one(POISSON, DENSITY))
