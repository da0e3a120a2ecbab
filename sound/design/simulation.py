"""Modes of a solid as functions of its material's coordinates, with derivatives."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from carillon.arrays import Array, Index
from carillon.composition.composition import PlacedRegions
from carillon.errors import ConvergenceError
from carillon.fem.block import degrees_of_freedom
from carillon.fem.finite_cells.cells import FiniteCells
from carillon.fem.geometry import HexMesh
from carillon.fem.model import Solid
from carillon.fem.regions import Regions
from carillon.fem.supports import Supports
from carillon.limits import FEWEST_MODES
from carillon.processes.mpi import MPI
from solver.analysis.modal_solver import ModalSolver
from solver.analysis.modes import Modes
from solver.analysis.options import SolverOptions
from solver.analysis.problem import ProblemOptions
from solver.linear import Inverse, Lasting
from solver.response.points import forces_at
from sound.design.elements import RegionElements, analysed_elements
from sound.design.masses import SolidModes, by_density, nodal_mass
from sound.design.material import FIRST, SECOND, ReducedMaterial, elasticity_slope
from sound.design.modal_truncation import lies_between, outside_response, shift_between
from sound.design.sensitivity import (
    LawElements,
    Sensitivity,
    all_pairs,
    close_pairs,
    inside_response,
    projected_stiffness,
)
from sound.radiation.transfer import Transfer
from sound.strikes import Strike

TOLERANCE = 1e-3
"""Relative error of eigenvalues at which an analysis stops; 1e-3 is about a hundredth of a bark."""
RESPONSE = 0.1
"""Accuracy of the modal truncation's correction, over the square root of that of the
eigenvalues."""


@dataclass
class Evaluation:
    """The modes of the material of coordinates z (m,).

    `eigenvalues` (N,) [rad^2/s^2] of the elastic modes ascend; `pushed` (T + r, N) [kg^-1/2 N s] is
    u_k^T f of a unit impulse f along the inward normal at each point, and of the r patterns by
    which modes are heard, if there are any.  `modes` are all of the
    analysis, as a start of the next one.  `sensitivity`, the derivatives, and `inverse`, (K - mu
    M)^-1 of this material, are None if they were not computed.
    """

    z: Array
    eigenvalues: Array
    pushed: Array
    modes: Modes
    sensitivity: Sensitivity | None = None
    inverse: Inverse | None = None


class Simulation:
    """Elastic modes, `modes` in number, of a solid for any coordinates of its material.

    Parameters
    ----------
    mesh, cells
        Voxels, and finite cells with these voxels if there are any.
    options, material
        Constants, coarsening and forests; moduli as a function of the coordinates.
    strikes, tolerance
        Struck points; relative error of the eigenvalues.
    placed, supports
        Regions of the voxels, in place of the constants of the options, and what holds the solid.
    heard
        Transfer to the place where modes are heard, None if they count as they are struck.

    Attributes
    ----------
    evaluations : int
        Number of modal analyses so far, including those that failed.
    """

    def __init__(
        self,
        mesh: HexMesh,
        options: ProblemOptions,
        material: ReducedMaterial,
        strikes: Sequence[Strike],
        modes: int,
        tolerance: float = TOLERANCE,
        cells: FiniteCells | None = None,
        placed: PlacedRegions | None = None,
        supports: Supports | None = None,
        heard: Transfer | None = None,
    ) -> None:
        self.material = material
        self.elements = analysed_elements(mesh, options, cells, placed, supports)
        self.modes = modes
        self.evaluations = 0
        self._kept = self.model.rigid_modes + modes
        analysis = SolverOptions(modes=max(FEWEST_MODES, self._kept), tolerance=tolerance)
        self.solver = ModalSolver(self.model, analysis, MPI.COMM_SELF)
        # Rows of the analysis are in the order of its partition.
        self._order = degrees_of_freedom(self.solver.local_mesh.nodes)
        self._pushes = pushes(self.model, strikes, heard)[self._order]
        self._accuracy = RESPONSE * np.sqrt(tolerance)

    @property
    def model(self) -> Solid:
        """The solid that is analysed, with moduli of 1 Pa."""
        return self.elements.model

    def evaluate(
        self, z: Array, start: Modes | Array | None = None, derivatives: bool = False
    ) -> Evaluation:
        """Modes at the coordinates z, with derivatives if asked for; those at near ones are a
        `start`.
        """
        self.evaluations += 1
        young = self.material.moduli(z)
        regions = self.regions(z) if len(self.material.free) else None
        modes = _lowest(self.elements.solve(self.solver, young, start, regions), self._kept)
        elastic = modes.elastic
        similar = start.inverse if isinstance(start, Modes) else None
        own = None if modes.inverse is similar else modes.inverse
        pushed = self._pushes.T @ elastic
        evaluation = Evaluation(z, modes.values[modes.rigid :], pushed, modes, inverse=own)
        return self.differentiate(evaluation) if derivatives else evaluation

    def evaluate_anyway(self, z: Array, start: Modes | None) -> Evaluation:
        """Modes at the coordinates z; if the analysis from `start` fails, without a start."""
        if start is not None:
            with suppress(ConvergenceError):
                return self.evaluate(z, start)
        return self.evaluate(z)

    def differentiate(self, evaluation: Evaluation, whole: bool = False) -> Evaluation:
        """The evaluation with derivatives; if `whole`, those of all pairs of modes one by one.

        Its modes then hold the inverse of their own material, for analyses that start there.
        """
        modes, values = evaluation.modes, evaluation.eigenvalues
        inverse = evaluation.inverse
        if inverse is None or not lies_between(values, inverse.shift):
            inverse = self.solver.inverse(modes, shift_between(values))
        sensitivity = self._sensitivity(evaluation, inverse, whole)
        if isinstance(inverse, Lasting):
            modes = replace(modes, inverse=inverse)
        else:
            inverse.destroy()
        return replace(evaluation, sensitivity=sensitivity, modes=modes)

    def _sensitivity(self, evaluation: Evaluation, inverse: Inverse, whole: bool) -> Sensitivity:
        young = self.material.moduli(evaluation.z)
        elastic = np.ascontiguousarray(evaluation.modes.elastic)
        directions = self.material.slopes(young)[:, None] * self.material.basis
        slopes = self.elements.slopes(young, directions)
        regions, free = self.regions(evaluation.z), self.material.free
        values = evaluation.eigenvalues
        outside = outside_response(
            evaluation.modes, inverse, elastic, values, self._pushes, self._accuracy
        )
        if not whole:
            outside += inside_response(elastic, values, evaluation.pushed)
        vectors, others = np.empty_like(elastic), np.empty_like(outside)
        vectors[self._order], others[self._order] = elastic, outside
        pairs = all_pairs(len(values)) if whole else close_pairs(values)
        # The moduli at the points are linear in a common factor.
        moduli = self.elements.slopes(young, young[:, None]) if free.poisson else slopes
        parts = self._parts(regions, slopes)
        if free.poisson:
            moves = {row for each in free.poisson for row in each.rows}
            parts = (
                self._with_slope_of_poisson(part, regions, own, at_points)
                if part.region in moves
                else own
                for part, own, at_points in zip(self.elements.parts, parts, moduli)
            )
        size = self.material.dimensions
        inside, beyond = projected_stiffness(parts, vectors, pairs, others, size)
        if free.density:
            self._add_densities(evaluation, regions, pairs, vectors, others, inside, beyond)
        return Sensitivity(pairs, inside, beyond)

    def regions(self, z: Array) -> Regions:
        """Materials of the regions at the coordinates z."""
        return self.material.regions(z, self.model.regions)

    def _with_slope_of_poisson(
        self, part: RegionElements, regions: Regions, own: LawElements, moduli: Array
    ) -> LawElements:
        """A region's elements with strains and slopes of Poisson's ratio added.

        The derivative of the stiffness by Poisson's ratio is a combination of the stiffnesses at
        two other ratios, whose strains are added as further points.
        """
        nodes, strains, slopes = own
        row, poisson = part.region, regions.laws[part.region].poisson
        assert poisson is not None
        free = next(each.number for each in self.material.free.poisson if row in each.rows)
        by_point = moduli.reshape(-1, len(strains))
        by_cell = np.zeros((len(by_point), 3, len(strains), slopes.shape[1]))
        by_cell[:, 0] = slopes.reshape(len(by_point), len(strains), -1)
        for place, weight in enumerate(elasticity_slope(poisson), start=1):
            by_cell[:, place, :, self.material.moving] = free.slope(poisson) * weight * by_point
        further = [self.elements.strains(part, ratio) for ratio in (FIRST, SECOND)]
        together = np.concatenate([strains, *further])
        return LawElements(nodes, together, by_cell.reshape(-1, slopes.shape[1]))

    def _parts(self, regions: Regions, slopes: Sequence[Array]) -> Iterator[LawElements]:
        """The elements by region, with the derivatives of their moduli."""
        for part, own in zip(self.elements.parts, slopes, strict=True):
            nodes = self.model.connectivity[part.cells]
            law = regions.laws[part.region]
            yield LawElements(nodes, self.elements.strains(part, law), own)

    @cached_property
    def _masses(self) -> list[sp.csr_matrix]:
        """Nodal masses of regions whose density is free, for density 1."""
        return [nodal_mass(self.model, each.rows) for each in self.material.free.density]

    def _add_densities(
        self,
        evaluation: Evaluation,
        regions: Regions,
        pairs: Index,
        elastic: Array,
        others: Array,
        inside: Array,
        beyond: Array,
    ) -> None:
        """Set the rows of free densities in derivatives `inside` (m, P) and `beyond` (m, T, N)."""
        rigid = evaluation.modes.vectors[:, : evaluation.modes.rigid]
        pushed = self.mesh_rows(self._pushes)
        modes = SolidModes(evaluation.eigenvalues, elastic, self.mesh_rows(rigid), pushed)
        free = self.material.free
        first = self.material.moving + free.first_density
        for row, (each, mass) in enumerate(zip(free.density, self._masses, strict=True), first):
            slope = each.number.slope(float(regions.density[each.rows[0]]))
            products = by_density(mass, modes, pairs, others)
            inside[row], beyond[row] = (slope * product for product in products)

    def energy_shares(self, evaluation: Evaluation, regions: NDArray[np.integer]) -> Array:
        """Shares (N, R) of R regions in the modes' strain energies, from the region (M,) of each
        voxel.

        The share of a region is the derivative of log(lambda) by the logarithm of a factor of its
        moduli.  The stiffness is linear in a factor of all moduli, through any coarsening, so the
        shares of a mode add up to 1; for elements across regions, one may be slightly negative.
        Raises UserError if the coarsening has no derivatives.
        """
        young = self.material.moduli(evaluation.z)
        own = young[:, None] * (regions[:, None] == np.arange(regions.max() + 1))
        vectors = self.mesh_rows(evaluation.modes.elastic)
        count = vectors.shape[1]
        energies, _ = projected_stiffness(
            self._parts(self.regions(evaluation.z), self.elements.slopes(young, own)),
            vectors,
            all_pairs(count)[:count],
            np.empty((len(vectors), 0, count)),
            own.shape[1],
        )
        return np.asarray((energies / evaluation.eigenvalues).T)

    def mesh_rows(self, vectors: Array) -> Array:
        """Vectors (n_dofs, k) in mesh node order from those in the order of an analysis."""
        rows = np.empty_like(vectors)
        rows[self._order] = vectors
        return rows


def _lowest(modes: Modes, count: int) -> Modes:
    """The lowest so many modes; those beyond are of use to a start alone."""
    if len(modes.values) <= count:
        return modes
    beyond = [modes.vectors[:, count:], *([] if modes.guard is None else [modes.guard])]
    return replace(
        modes,
        values=modes.values[:count],
        vectors=np.ascontiguousarray(modes.vectors[:, :count]),
        residuals=modes.residuals[:count],
        guard=np.concatenate(beyond, axis=1),
    )


def pushes(model: Solid, strikes: Sequence[Strike], heard: Transfer | None = None) -> Array:
    """Forces (n_dofs, T + r): unit impulses [N s] along the inward normals of struck points, then
    the loads of a transfer if there is one."""
    positions = np.array([strike.position for strike in strikes])
    inward = np.array([strike.inward for strike in strikes])
    forces = forces_at(model, positions, inward)
    return forces if heard is None else np.concatenate([forces, heard.loads(model)], axis=1)
