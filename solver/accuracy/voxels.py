"""How far the frequencies of voxels are from those of the solid, by finite cells."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from carillon.arrays import Array, Surface
from carillon.fem.finite_cells.build import covering, whole_cells
from carillon.fem.finite_cells.covering import Covering
from carillon.fem.finite_cells.model import FiniteCellModel, finite_cell_model
from carillon.fem.geometry.grid import Grid, bounding_grid
from solver.accuracy.estimate import estimate_cell_errors
from solver.accuracy.material import INTERPOLATED, PlacedMaterial
from solver.analysis.problem import Problem, ProblemOptions
from solver.refinement.errors import ExpectedErrors

WHOLE = 4
"""Number of voxels along the edge of a finite cell at half the resolution."""


@dataclass(frozen=True)
class Reference:
    """Finite cells of the solid that voxels stand for, with the voxels' material."""

    model: FiniteCellModel

    @classmethod
    def of_voxels(cls, options: ProblemOptions, problem: Problem) -> Self:
        """Finite cells on the lattice of a problem's voxels, which `options` describe.

        Raises UserError if the solid is lost between the lines of the lattice.
        """
        surface = problem.surface
        lattice = voxel_lattice(surface.triangles, options.resolution)
        cells = covering_on(surface.triangles, lattice, "largest", surface.name).cells
        gradual = options.material in INTERPOLATED
        placed, factor = problem.placed_on(cells), problem.young
        if problem.region is not None:
            factor = factor / problem.regions.young[problem.region]
        material = PlacedMaterial.of_voxels(lattice, problem.fine, factor, gradual)
        young = material.on(cells.mesh)
        if placed.region is not None:
            young = placed.regions.moduli(placed.region, young)
        return cls(
            finite_cell_model(
                cells,
                young,
                placed.regions,
                placed.region,
                placed.shared,
                problem.model.supports,
            )
        )

    def errors(self, voxels: Array, values: Array, modes: Array) -> ExpectedErrors:
        """Expected errors of the frequencies of the voxels, or of coarse elements of them.

        Parameters
        ----------
        voxels
            (k,) eigenvalues [rad^2/s^2] of the voxels or coarse elements.
        values, modes
            (l,) eigenvalues and (n_dofs, l) modes of the finite cells.
        """
        own = estimate_cell_errors(self.model, values, modes).errors.errors
        rigid = self.model.rigid_modes
        count = min(len(own), len(voxels) - rigid)
        chosen = slice(rigid, rigid + count)
        ratio = np.sqrt(np.maximum(voxels[chosen], 0.0) / values[chosen])
        return ExpectedErrors(ratio * (1.0 + own[:count]) - 1.0, rigid)


def voxel_lattice(surface: Surface, resolution: int) -> Grid:
    """Lattice of the voxels of a surface, with empty ones up to whole cells of half the resolution.

    They follow at the far ends, so that the voxels of the surface are on it.
    """
    grid = bounding_grid(surface, resolution)
    return whole_cells(grid, WHOLE)


def covering_on(surface: Surface, lattice: Grid, components: str, name: str) -> Covering:
    """Finite cells on a lattice, see `carillon.fem.finite_cells.build.finite_cells`."""
    longest = float(np.ptp(surface.bounds, axis=0).max())
    return covering(surface, round(longest / lattice.edge), components, name, lattice)
