"""Spectra by the public way to finite cells, with what is told of them."""

import tempfile
import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from carillon.arrays import Array
from carillon.errors import ConvergenceError, UserError
from carillon.fem.finite_cells.model import FiniteCellModel
from carillon.fem.model import RIGID_MODES, Solid
from carillon.processes.mpi import MPI
from solver.accuracy.solving import AccuracyRequest, solve_solid
from solver.analysis.options import SolverOptions
from solver.analysis.problem import ProblemOptions
from solver.refinement.errors import FROM_SOLID, RefinementOptions
from solver.refinement.model_solver import SolveByOptions
from solver.verification.matching import frequency_errors
from studies.accuracy.expected import elastic_hertz
from studies.thin_walls.profiles import SECTIONS
from studies.thin_walls.references import COUNT, StoredReference
from studies.thin_walls.solids import WalledSolid

MODES = RIGID_MODES + COUNT


@dataclass(frozen=True)
class CellSpectrum:
    """Elastic frequencies (k,) [Hz] of finite cells, and what was told of them."""

    hertz: Array
    resolution: int
    """Lattice spacings along the longest side, which may be more than were asked for."""
    unknowns: int
    divided: list[int]
    """Numbers of cells by level: whole, divided once, and so on."""
    seconds: float
    """Wall time from the mesh file to the modes and their expected errors."""
    expected: float | None
    """Root mean square error that the program expects."""
    expected_worst: float | None

    def rated(self, exact: Array) -> dict[str, Any]:
        """Plain values, with the errors against the frequencies of the solid (k,) [Hz].

        `lowest` is the smallest ratio of a frequency to the reference, `mean` the mean error.
        """
        relative = self.hertz / exact[: len(self.hertz)] - 1.0
        errors = frequency_errors(relative, MODES)
        return self.described() | {
            "rms": errors.rms,
            "worst": errors.worst,
            "worst_mode": errors.worst_mode,
            "lowest": float(1.0 + relative.min()),
            "ratio": None if not self.expected else self.expected / errors.rms,
        }

    def described(self) -> dict[str, Any]:
        """Plain values of a solid without a reference."""
        names = ("resolution", "unknowns", "divided", "seconds", "expected", "expected_worst")
        return {name: getattr(self, name) for name in names} | {"hertz": self.hertz.tolist()}


def cell_spectrum(
    mesh: str,
    unit: float,
    resolution: int,
    accuracy: float | None = None,
    refine_to: float | None = None,
) -> CellSpectrum:
    """Modes as ``carillon modes MESH --discretisation finite-cell`` finds them, on this rank alone.

    Raises UserError for anything wrong with the solid, or if it would be too large to be so
    accurate.

    Parameters
    ----------
    mesh, unit
        Mesh file and metres per unit of it.
    resolution
        Lattice spacings along the longest side, at first if there is an `accuracy`.
    accuracy
        Expected error down to which the resolution is raised; None to leave it.
    refine_to
        Expected error down to which cells are divided: 0 divides none, None is the default of
        ``carillon modes``.
    """
    described = ProblemOptions(mesh, resolution, discretisation="finite-cell", unit=unit)
    options = SolverOptions(modes=MODES)
    tolerance = RefinementOptions(refine_to).tolerance("none", "finite-cell", accuracy=accuracy)
    request = AccuracyRequest(accuracy, tolerance, estimated=True)
    begin = time.perf_counter()
    solve = SolveByOptions(options, MPI.COMM_SELF)
    solved = solve_solid(described, solve, options, request, MPI.COMM_SELF)
    seconds = time.perf_counter() - begin
    assert solved.model is not None
    told = solved.achieved
    spectrum = CellSpectrum(
        elastic_hertz(solved, COUNT),
        solved.solid.resolution,
        solved.model.n_dofs,
        cells_by_level(solved.model),
        seconds,
        told.get(f"{FROM_SOLID}_rms"),
        told.get(f"{FROM_SOLID}_worst"),
    )
    solved.modes.destroy()
    return spectrum


def cells_by_level(model: Solid) -> list[int]:
    """Numbers of cells that are not divided, divided once, and so on."""
    assert isinstance(model, FiniteCellModel)
    return [int(count) for count in np.bincount(model.cells.levels)]


def tried_cells(
    solid: WalledSolid,
    position: str,
    reference: StoredReference | None,
    resolution: int,
    accuracy: float | None = None,
    refine_to: float | None = None,
    sections: int = SECTIONS,
) -> dict[str, Any]:
    """A spectrum of a solid as plain values, see `cell_spectrum`, or the `problem` with it."""
    with tempfile.TemporaryDirectory() as folder:
        # In units of the longest side, since files of triangles round to them.
        surface = solid.surface(position, sections)
        unit = float(surface.extents.max())
        mesh = f"{folder}/solid.stl"
        surface.copy().apply_scale(1.0 / unit).export(mesh)
        try:
            found = cell_spectrum(mesh, unit, resolution, accuracy, refine_to)
        except (UserError, ConvergenceError) as error:
            return {"problem": str(error)}
    return found.described() if reference is None else found.rated(reference.hertz)
