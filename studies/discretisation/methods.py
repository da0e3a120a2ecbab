"""Ways from a surface and a material to a spectrum, timed."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array, Surface
from carillon.fem.finite_cells.covering import Covering
from carillon.fem.finite_cells.model import FiniteCellModel, finite_cell_model
from carillon.fem.geometry import HexMesh, hexmesh_from_voxels, voxelize
from carillon.fem.geometry.grid import Grid
from carillon.fem.model import Constants, Solid, fine_model
from carillon.processes.mpi import MPI
from solver.accuracy.divide import DividedCells, solve_refined
from solver.accuracy.material import ARITHMETIC, HARMONIC, PlacedMaterial
from solver.accuracy.voxels import covering_on
from solver.analysis.modal_solver import modal_analysis
from solver.analysis.modes import Modes
from solver.analysis.options import SolverOptions
from solver.coarsening.coarsening import Coarsening
from solver.coarsening.model import build_model
from solver.files.modes_file import CHECKS, frequencies
from solver.refinement.coarse_or_fine import solve_coarsened
from solver.refinement.errors import ALLOWED_DISTANCE, ALLOWED_ERROR
from solver.refinement.model_solver import SolveByOptions
from solver.refinement.refined_model import RefinedModel

TOLERANCE = 1e-6
"""Relative error of the eigenvalues that every way corrects to."""


@dataclass(frozen=True)
class TimedSpectrum:
    """Frequencies (k,) [Hz], rigid motions first, of a model, and wall seconds by phase."""

    hertz: Array
    n_dofs: int
    seconds: dict[str, float]


class _Clock:
    """Wall seconds from phase to phase."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._mark = time.perf_counter()

    def end(self, phase: str, without: float = 0.0) -> None:
        """End a phase, some seconds of which do not count."""
        before, self._mark = self._mark, time.perf_counter()
        self.seconds[phase] = self._mark - before - without


@dataclass(frozen=True)
class Ways:
    """All ways for one solid, each from its surface on; on this rank alone."""

    surface: Surface
    name: str
    components: str
    """See `carillon.fem.geometry.voxelize`."""
    resolution: int
    """Voxels along the longest side."""
    material: PlacedMaterial
    """Young's modulus at any place, by the lattice of the voxels."""
    constants: Constants
    """Poisson's ratio and density [kg/m^3]."""
    coarsening: Coarsening
    """For its blocks."""
    modes: int
    """Number of modes, rigid ones included."""

    @property
    def named(self) -> dict[str, Callable[[], TimedSpectrum]]:
        """All that are compared, by name."""
        ways = {
            "voxels": self.voxels,
            "coarse": self.coarse,
            "refined": self.refined,
            "half-cells": lambda: self.cells(0.5),
            "half-cells-divided": lambda: self.divided(0.5),
        }
        if not self.material.interpolated:
            ways["half-cells-harmonic"] = lambda: self.cells(0.5, HARMONIC)
        return {**ways, "cells": lambda: self.cells(1.0)}

    def voxels(self) -> TimedSpectrum:
        """The voxels themselves."""
        clock = _Clock()
        mesh, young = self._voxels(clock)
        return self._solved(fine_model(mesh, young, **self.constants), clock)

    def coarse(self) -> TimedSpectrum:
        """Coarse elements of their blocks."""
        clock = _Clock()
        mesh, young = self._voxels(clock)
        model = build_model(mesh, young, self.coarsening, **self.constants)
        return self._solved(model, clock)

    def refined(self) -> TimedSpectrum:
        """The same with blocks fine for an expected error of `ALLOWED_ERROR`, or the voxels."""
        clock = _Clock()
        mesh, young = self._voxels(clock)
        fine = fine_model(mesh, young, **self.constants)
        refined = RefinedModel(fine, self.coarsening)
        clock.end("model")
        options = self._options
        solve = SolveByOptions(options, MPI.COMM_SELF)
        found = solve_coarsened(solve, refined, ALLOWED_ERROR, options, MPI.COMM_SELF)
        clock.end("solve", _checks(found.modes))
        assert found.model is not None
        return _spectrum(found.model, found.modes, clock)

    def divided(self, factor: float) -> TimedSpectrum:
        """Cells of which some are divided for an expected error of `ALLOWED_DISTANCE`."""
        clock = _Clock()
        cover, model = self._cells(factor, ARITHMETIC, clock)
        start = DividedCells(cover, model)
        clock.end("model")
        checks = 0.0

        def solve(model: Solid | None) -> Modes:
            nonlocal checks
            assert model is not None
            modes = self._modes_of(model)
            checks += _checks(modes)
            return modes

        divided, modes, _ = solve_refined(solve, start, ALLOWED_DISTANCE, MPI.COMM_SELF)
        clock.end("solve", checks)
        assert divided is not None
        return _spectrum(divided, modes, clock)

    def cells(self, factor: float, power: float = ARITHMETIC) -> TimedSpectrum:
        """Finite cells on a lattice of `factor` voxels in the place of one.

        Where one joins several, it has the mean of their moduli, see `PlacedMaterial.on`.
        """
        clock = _Clock()
        return self._solved(self._cells(factor, power, clock)[1], clock)

    def _cells(
        self, factor: float, power: float, clock: _Clock
    ) -> tuple[Covering, FiniteCellModel]:
        lattice = scaled(self.material.lattice, factor)
        cover = covering_on(self.surface, lattice, self.components, self.name)
        mesh = cover.cells.mesh
        clock.end("mesh")
        young = self.material.on(mesh, power)
        clock.end("material")
        return cover, finite_cell_model(cover.cells, young, self.constants["regions"])

    def _voxels(self, clock: _Clock) -> tuple[HexMesh, Array]:
        mesh = voxel_mesh(self.surface, self.resolution, self.components, self.name)
        clock.end("mesh")
        young = self.material.on(mesh)
        clock.end("material")
        return mesh, young

    def _solved(self, model: Solid, clock: _Clock) -> TimedSpectrum:
        clock.end("model")
        modes = self._modes_of(model)
        clock.end("solve", _checks(modes))
        return _spectrum(model, modes, clock)

    def _modes_of(self, model: Solid) -> Modes:
        return modal_analysis(model, self._options, MPI.COMM_SELF)

    @property
    def _options(self) -> SolverOptions:
        return SolverOptions(modes=self.modes, tolerance=TOLERANCE)


def _checks(modes: Modes) -> float:
    return sum(seconds for phase, seconds in modes.seconds.items() if phase in CHECKS)


def _spectrum(model: Solid, modes: Modes, clock: _Clock) -> TimedSpectrum:
    hertz = frequencies(modes.values)
    modes.destroy()
    return TimedSpectrum(hertz, model.n_dofs, clock.seconds)


def scaled(lattice: Grid, factor: float) -> Grid:
    """The lattice with `factor` voxels along the edge of each, or one in place of several.

    Examples
    --------
    >>> lattice = Grid(np.zeros(3), 0.5, (8, 4, 4))
    >>> scaled(lattice, 2).shape, scaled(lattice, 0.5).edge
    ((16, 8, 8), 1.0)
    """
    nx, ny, nz = (round(factor * size) for size in lattice.shape)
    return Grid(np.asarray(lattice.origin), lattice.edge / factor, (nx, ny, nz))


def voxel_mesh(surface: Surface, resolution: int, components: str, name: str) -> HexMesh:
    """Voxels of a surface, see `carillon.fem.geometry.voxelize`."""
    return hexmesh_from_voxels(voxelize(surface, resolution, components=components, name=name))
