"""Modes of a solid whose voxels are of a few materials, and how they change with these.

To make a voxel of another material changes stiffness and mass by dK and dM, which are linear in the
elasticity and the density; to first order

    d lambda_k = u_k^T (dK - lambda_k dM) u_k

and a pushed mode changes as `sound.design.masses` says. Each voxel's share in u^T K u, u^T M u and
in the products for pushed modes, for each of the materials, gives all changes of one voxel at once.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from carillon.arrays import Array, Index
from carillon.composition.composition import PlacedRegions
from carillon.fem.block import coarse_cell_mass, degrees_of_freedom
from carillon.fem.model import ElasticModel, fine_model
from carillon.fem.regions import RegionOf, Regions
from carillon.fem.supports import Supports
from carillon.limits import FEWEST_MODES
from carillon.processes.mpi import MPI
from solver.analysis.modal_solver import ModalSolver
from solver.analysis.modes import Modes
from solver.analysis.options import SolverOptions
from sound.design.elements import analysed_elements
from sound.design.modal_truncation import outside_response, shift_between
from sound.design.objective import DesignCost, Objective
from sound.design.sensitivity import Sensitivity, close_pairs, energies_of_cells, inside_response
from sound.design.simulation import RESPONSE, pushes
from sound.design.tasks import Setting

TOLERANCE = 1e-4
"""Relative error of eigenvalues at which an analysis of the search stops: less than 0.1 cents."""

INCLUSION = 0.5
"""c of `VoxelSolid.changes`."""


@dataclass(frozen=True)
class VoxelModes:
    """Modes of a solid whose voxels have the materials `numbers` (M,), and its cost.

    Rows of `elastic` (3 n, N) and `rigid` (3 n, r) are those of the mesh; `values` (N,)
    [rad^2/s^2] ascend, `pushed` (T, N) is as in `sound.design.simulation.Evaluation`.
    """

    numbers: RegionOf
    values: Array
    pushed: Array
    elastic: Array
    rigid: Array
    cost: DesignCost
    modes: Modes
    solver: ModalSolver
    order: Index
    """(3 n,) rows of the mesh in the order of the analysis."""

    @property
    def start(self) -> Array:
        """Modes that the analysis of similar materials starts from."""
        return self.modes.start()


class VoxelSolid:
    """The fine solid of a design, whose voxels are of the materials of a `table`.

    The `objective` tells the cost; that of roughness is not part of it. What holds the solid is as
    stiff beside the stiffest material as it was beside the one that the design's search began with.
    `evaluations` counts its modal analyses.
    """

    def __init__(self, setting: Setting, table: Regions, objective: Objective) -> None:
        self.mesh, self.table, self.objective = setting.mesh, table, objective
        self.supports = _held(setting, table)
        self._options = replace(setting.options, coarsen="none")
        self._setting = setting
        self._kept = len(objective.targets.frequencies)
        self.evaluations = 0

    def model(self, numbers: RegionOf) -> ElasticModel:
        """The solid whose voxels have these materials (M,)."""
        young = self.table.moduli(numbers)
        return fine_model(self.mesh, young, numbers, regions=self.table, supports=self.supports)

    def evaluate(
        self, numbers: RegionOf, start: Array | None = None, tolerance: float = TOLERANCE
    ) -> VoxelModes:
        """Modes and cost of materials (M,); raises ConvergenceError if there are none."""
        self.evaluations += 1
        model = self.model(numbers)
        kept = model.rigid_modes + self._kept
        options = SolverOptions(modes=max(FEWEST_MODES, kept), tolerance=tolerance)
        solver = ModalSolver(model, options, MPI.COMM_SELF)
        modes = solver.solve(initial_modes=start)
        order = degrees_of_freedom(solver.local_mesh.nodes)
        rows = np.empty((len(order), kept))
        rows[order] = modes.vectors[:, :kept]
        values, elastic = modes.values[modes.rigid : kept], rows[:, modes.rigid :]
        pushed = self._forces(model).T @ elastic
        cost = self.objective.cost(values, pushed, 0.0)
        rigid = rows[:, : modes.rigid]
        return VoxelModes(numbers, values, pushed, elastic, rigid, cost, modes, solver, order)

    def changes(self, at: VoxelModes, groups: Index, inclusion: float = INCLUSION) -> Sensitivity:
        """Changes of the modes if all voxels of a group become of a material.

        `groups` (M,) are the numbers of the voxels' groups, from 0 on without a gap. Change g r + m
        of r materials makes group g of material m; it is 0 for what the group is of already.

        To first order, with `inclusion` 0, the strain of a voxel stays as it was. In truth a voxel
        that becomes stiffer is strained less. That of a stiff or soft inclusion with modulus E'
        in a material of modulus E is 1 / (1 + c (E' - E) / E) of that around it, of a sphere with
        c between 0.4 and 0.6 (Eshelby 1957), by which the change of the stiffness is multiplied.
        """
        model, values, table = self.model(at.numbers), at.values, self.table
        forces = self._forces(model)
        others = _others(at, forces)
        pairs = close_pairs(values)
        mass = self._mass_products(at, model, forces, pairs, others)
        elements = analysed_elements(
            self.mesh, self._options, None, PlacedRegions(table, at.numbers), None
        )
        found: dict[tuple[float, ...], Array] = {}
        for law in table.laws:
            key = tuple(law.matrix.ravel())
            if key not in found:
                strains = elements.strains(elements.parts[0], law)
                nodes = model.connectivity
                found[key] = energies_of_cells(nodes, strains, at.elastic, pairs, others)
        energies = [found[tuple(law.matrix.ravel())] for law in table.laws]
        count, materials = int(groups.max()) + 1, len(table)
        totals = np.zeros((count, materials, mass.shape[1]))
        for old in np.unique(at.numbers):
            own = np.flatnonzero(at.numbers == old)
            for new in range(materials):
                if new == old:
                    continue
                stiffer = table.young[new] / table.young[old] - 1.0
                stiffness = table.young[new] * energies[new][own]
                stiffness -= table.young[old] * energies[old][own]
                stiffness /= 1.0 + inclusion * stiffer
                heavier = table.density[new] - table.density[old]
                np.add.at(totals[:, new], groups[own], stiffness + heavier * mass[own])
        flat = totals.reshape(count * materials, -1)
        inside, beyond = flat[:, : len(pairs)], flat[:, len(pairs) :]
        return Sensitivity(pairs, inside, beyond.reshape(-1, *others.shape[1:]))

    def _forces(self, model: ElasticModel) -> Array:
        return pushes(model, self._setting.strikes, self.objective.heard)

    def _mass_products(
        self, at: VoxelModes, model: ElasticModel, forces: Array, pairs: Index, others: Array
    ) -> Array:
        """Products (M, P + T N) like those of the stiffness, by each voxel's mass at density 1."""
        values, count = at.values, len(at.values)
        unit = coarse_cell_mass().sum(axis=0) * (self.mesh.edge / 2.0) ** 3
        factor = np.kron(np.linalg.cholesky(unit).T, np.eye(3)).reshape(4, 6, 24)
        # x_k of a motion without strain is over lambda_k.
        moved = others * values + (at.rigid @ (at.rigid.T @ forces))[:, :, None]
        products = energies_of_cells(model.connectivity, factor, at.elastic, pairs, moved)
        grams = products[:, : len(pairs)]
        i, j = pairs.T
        inside = -0.5 * (values[i] + values[j]) * grams
        beyond = -products[:, len(pairs) :].reshape(len(grams), -1, count)
        # Half of the change of each norm goes to each mode of a pair.
        for pair, (one, other) in enumerate(pairs):
            beyond[:, :, other] -= 0.5 * at.pushed[:, one] * grams[:, pair, None]
            if one != other:
                beyond[:, :, one] -= 0.5 * at.pushed[:, other] * grams[:, pair, None]
        return np.concatenate([inside, beyond.reshape(len(grams), -1)], axis=1)


def _others(at: VoxelModes, forces: Array) -> Array:
    """x (3 n, T, N) of `sound.design.sensitivity`, in the order of the mesh."""
    own, values = np.ascontiguousarray(at.elastic[at.order]), at.values
    inverse = at.solver.inverse(at.modes, shift_between(values))
    accuracy = RESPONSE * np.sqrt(TOLERANCE)
    found = outside_response(at.modes, inverse, own, values, forces[at.order], accuracy)
    found += inside_response(own, values, at.pushed)
    inverse.destroy()
    others = np.empty_like(found)
    others[at.order] = found
    return others


def _held(setting: Setting, table: Regions) -> Supports | None:
    """Supports as stiff beside the stiffest material as they were beside the search's."""
    supports = setting.supports
    if supports is None or setting.objective.absolute:
        return supports
    # Nothing but held places: springs that are stiff beside the solid.
    reference = setting.material.moduli(np.zeros(setting.material.dimensions)).max()
    return replace(supports, stiffness=supports.stiffness * float(table.young.max() / reference))
