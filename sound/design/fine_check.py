"""Modes of the fine solid, matched with those of the coarse solid of a search."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from carillon.arrays import Array, Index
from carillon.fem.block import degrees_of_freedom
from carillon.fem.geometry import hexmesh_from_grid
from carillon.fem.model import ElasticModel, Solid, fine_model
from carillon.limits import FEWEST_MODES
from carillon.processes.mpi import MPI
from carillon.processes.threads import one_thread
from solver.analysis.modal_solver import ModalSolver
from solver.analysis.modes import Modes
from solver.analysis.options import SolverOptions
from solver.files.modes_file import frequencies
from solver.response.points import interpolation
from sound.design.descent import cost_of
from sound.design.objective import DesignCost
from sound.design.simulation import Evaluation, Simulation
from sound.design.tasks import Setting
from sound.project.design import Design, FineFrequencies

CLEAR = 0.7
"""Least modal assurance criterion of two modes that count as one shape."""
FINE_TOLERANCE = 1e-5
"""Relative error of the fine eigenvalues: a hundredth of a cent."""


@dataclass(frozen=True)
class FineModes:
    """Elastic modes of the fine solid, matched with coarse ones.

    `frequencies` (N,) [Hz] ascend; `order` (N,) are the numbers of the coarse modes of the same
    shapes, and `coarse` (N,) [Hz] their frequencies.  `excess` (T, N) are the balances of
    amplitudes of these coarse modes minus those of the fine modes, `cost` is that of the fine
    solid, Eq. (4).
    """

    frequencies: Array
    order: Index
    coarse: Array
    excess: Array
    cost: DesignCost

    @property
    def ratios(self) -> Array:
        """Coarse frequencies (N,) over fine ones."""
        return np.asarray(self.coarse / self.frequencies)


class FineSolid:
    """The fine solid of a search that coarsens; modes of one material are the start of the next
    analysis.

    `coarse` simulates the coarse solid.  One thread is used, as by the search, so results do not
    depend on the machine's cores.
    """

    def __init__(self, setting: Setting, coarse: Simulation) -> None:
        self._setting, self._coarse = setting, coarse
        with one_thread():
            self._simulation = setting.fine().simulation(FINE_TOLERANCE)
        self._shapes = ShapeMatch(coarse.model, self._simulation.model)
        self._last: Modes | None = None

    def modes(self, evaluation: Evaluation) -> FineModes:
        """Modes of the material of an evaluation of the coarse solid.

        Raises ConvergenceError if they were not found.
        """
        simulation, setting = self._simulation, self._setting
        with one_thread():
            fine = simulation.evaluate_anyway(evaluation.z, self._last)
            self._last = fine.modes
            hertz, coarse = frequencies(fine.eigenvalues), frequencies(evaluation.eigenvalues)
            order = self._shapes.order(
                self._coarse.mesh_rows(evaluation.modes.elastic),
                simulation.mesh_rows(fine.modes.elastic),
            )
            cost = cost_of(setting.objective, setting.material, fine)
        balance = setting.objective.balance
        own = balance(fine.eigenvalues, fine.pushed)
        excess = balance(evaluation.eigenvalues, evaluation.pushed)[:, order] - own
        return FineModes(hertz, order, coarse[order], excess, cost)


def fine_frequencies(design: Design) -> FineFrequencies:
    """Frequencies of a design on its fine solid; of one that was not coarsened, its own.

    Raises ConvergenceError if the modes were not found.
    """
    count = len(design.targets.frequencies)
    if not is_coarsened(design):
        return FineFrequencies(design.coarse_frequencies, np.arange(count))
    mesh = hexmesh_from_grid(design.fine_grid, design.fine_origin, design.fine_edge)
    model = fine_model(
        mesh,
        design.young,
        design.fine_region,
        regions=design.model.regions,
        supports=design.model.supports,
    )
    wanted = model.rigid_modes + count
    options = SolverOptions(modes=max(FEWEST_MODES, wanted), tolerance=FINE_TOLERANCE)
    solver = ModalSolver(model, options, MPI.COMM_SELF)
    modes = solver.solve()
    rows = np.empty_like(modes.vectors)
    rows[degrees_of_freedom(solver.local_mesh.nodes)] = modes.vectors
    order = ShapeMatch(design.model, model).order(
        design.modes[:, model.rigid_modes :], rows[:, model.rigid_modes : wanted]
    )
    return FineFrequencies(frequencies(modes.values[modes.rigid : wanted]), order)


def is_coarsened(design: Design) -> bool:
    """Whether the solid of a design is a coarsening of a finer one."""
    mesh = design.model.mesh
    return isinstance(design.model, ElasticModel) and mesh.n_cells != len(design.young)


class ShapeMatch:
    """Matching of the modes of a coarse and a fine solid, with any moduli, by their shapes."""

    def __init__(self, coarse: Solid, fine: Solid) -> None:
        # Lumped mass up to a factor: the number of elements at each node.
        self._mass = np.repeat(np.bincount(fine.connectivity.ravel()), 3)[:, None]
        self._interpolation = interpolation(coarse, fine.mesh.nodes)

    def order(self, coarse_modes: Array, fine_modes: Array) -> Index:
        """Numbers (N,) of the coarse modes (3 n, N) that match the fine ones (3 n, N), both
        ascending.

        Modes of clearly the same shape are pairs.  The others, whose shapes the coarse solid does
        not have, are paired in the order of frequency.
        """
        count = fine_modes.shape[1]
        nodal = self._interpolation @ coarse_modes.reshape(-1, 3 * count)
        seen = np.asarray(nodal).reshape(-1, count)
        overlap = fine_modes.T @ (self._mass * seen)
        own, others = ((self._mass * modes**2).sum(axis=0) for modes in (fine_modes, seen))
        alike = overlap**2 / np.outer(own, others)
        rows, order = linear_sum_assignment(alike, maximize=True)
        unclear = alike[rows, order] < CLEAR
        order[unclear] = np.sort(order[unclear])
        return np.asarray(order, dtype=np.int64)
