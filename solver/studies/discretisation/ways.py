"""Ways from a surface and a material to a spectrum, timed."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from carillon.fem.finite_cells.model import finite_cell_model
from carillon.fem.geometry import HexMesh
from carillon.fem.model import Constants, ElasticModel, Solid, fine_model
from solver.accuracy.lattices import cells_on, scaled, voxel_mesh
from solver.accuracy.material import ARITHMETIC, HARMONIC, PlacedMaterial
from solver.analysis.modal_solver import Modes, modal_analysis
from solver.analysis.options import SolverOptions
from solver.coarsening.coarsening import Coarsening
from solver.coarsening.model import build_model
from solver.files.modes_file import CHECKS, frequencies
from solver.refinement.options import ALLOWED_ERROR
from solver.refinement.refine import RefinedModel, solve_refined

if TYPE_CHECKING:  # Its import takes long, and many commands need no surface.
    import trimesh

Array = NDArray[np.float64]

TOLERANCE = 1e-6
"""Relative error of the eigenvalues that every way corrects to."""


@dataclass(frozen=True)
class Given:
    """A solid before it is discretised.

    Attributes
    ----------
    surface, name, components
        See `carillon.fem.geometry.voxelize`.
    resolution
        Voxels along the longest side.
    material
        Young's modulus at any place, by the lattice of the voxels.
    constants
        Poisson's ratio and density [kg/m^3].
    """

    surface: trimesh.Trimesh
    name: str
    components: str
    resolution: int
    material: PlacedMaterial
    constants: Constants


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


class Ways:
    """All ways for one solid, each from its surface on; on this rank alone.

    Parameters
    ----------
    given
        The solid.
    coarsening
        For its blocks.
    modes
        Number of modes, rigid ones included.
    """

    def __init__(self, given: Given, coarsening: Coarsening, modes: int) -> None:
        self._given = given
        self._coarsening = coarsening
        self._modes = modes

    @property
    def named(self) -> dict[str, Callable[[], TimedSpectrum]]:
        """All that are compared, by name."""
        ways = {
            "voxels": self.voxels,
            "coarse": self.coarse,
            "refined": self.refined,
            "half-cells": lambda: self.cells(0.5),
        }
        if not self._given.material.interpolated:
            ways["half-cells-harmonic"] = lambda: self.cells(0.5, HARMONIC)
        return {**ways, "cells": lambda: self.cells(1.0)}

    def voxels(self) -> TimedSpectrum:
        """The voxels themselves."""
        clock = _Clock()
        mesh, young = self._voxels(clock)
        return self._solved(fine_model(mesh, young, **self._given.constants), clock)

    def coarse(self) -> TimedSpectrum:
        """Coarse elements of their blocks."""
        clock = _Clock()
        mesh, young = self._voxels(clock)
        model = build_model(mesh, young, self._coarsening, **self._given.constants)
        return self._solved(model, clock)

    def refined(self) -> TimedSpectrum:
        """The same with blocks fine until the expected error is `ALLOWED_ERROR`."""
        clock = _Clock()
        mesh, young = self._voxels(clock)
        start = RefinedModel(fine_model(mesh, young, **self._given.constants), self._coarsening)
        clock.end("model")
        checks = 0.0

        def solve(model: ElasticModel | None) -> Modes:
            nonlocal checks
            assert model is not None
            modes = self._modes_of(model)
            checks += _checks(modes)
            return modes

        model, modes, _ = solve_refined(solve, start, ALLOWED_ERROR, MPI.COMM_SELF)
        clock.end("solve", checks)
        assert model is not None
        return _spectrum(model, modes, clock)

    def cells(self, factor: float, power: float = ARITHMETIC) -> TimedSpectrum:
        """Finite cells on a lattice of `factor` voxels in the place of one.

        Where one joins several, it has the mean of their moduli, see `PlacedMaterial.on`.
        """
        given, clock = self._given, _Clock()
        lattice = scaled(given.material.lattice, factor)
        cells = cells_on(given.surface, lattice, given.components, given.name)
        clock.end("mesh")
        young = given.material.on(cells.mesh, power)
        clock.end("material")
        poisson, density = given.constants["poisson"], given.constants["density"]
        return self._solved(finite_cell_model(cells, young, poisson, density), clock)

    def _voxels(self, clock: _Clock) -> tuple[HexMesh, Array]:
        given = self._given
        mesh = voxel_mesh(given.surface, given.resolution, given.components, given.name)
        clock.end("mesh")
        young = given.material.on(mesh)
        clock.end("material")
        return mesh, young

    def _solved(self, model: Solid, clock: _Clock) -> TimedSpectrum:
        clock.end("model")
        modes = self._modes_of(model)
        clock.end("solve", _checks(modes))
        return _spectrum(model, modes, clock)

    def _modes_of(self, model: Solid) -> Modes:
        return modal_analysis(
            model, SolverOptions(modes=self._modes, tolerance=TOLERANCE), MPI.COMM_SELF
        )


def _checks(modes: Modes) -> float:
    return sum(seconds for phase, seconds in modes.seconds.items() if phase in CHECKS)


def _spectrum(model: Solid, modes: Modes, clock: _Clock) -> TimedSpectrum:
    hertz = frequencies(modes.values)
    modes.destroy()
    return TimedSpectrum(hertz, model.n_dofs, clock.seconds)
