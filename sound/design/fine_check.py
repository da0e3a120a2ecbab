"""The modes of the fine solid beside those of the coarse one that a search works with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from carillon.fem.block import degrees_of_freedom
from carillon.fem.geometry import hexmesh_from_grid
from carillon.fem.model import RIGID_MODES, ElasticModel, Solid, fine_model
from carillon.processes.threads import one_thread
from solver.analysis.modal_solver import ModalSolver
from solver.analysis.modes import Modes
from solver.analysis.options import SolverOptions
from solver.files.modes_file import frequencies
from solver.response.contact import interpolation
from sound.design.descent import cost_of
from sound.design.objective import DesignCost
from sound.design.simulation import Evaluation, Simulation
from sound.design.tasks import Setting
from sound.project.design import Design, FineFrequencies

Array = NDArray[np.float64]
Index = NDArray[np.int64]

CLEAR = 0.7
"""Modal assurance criterion from which two shapes are taken for one."""
FINE_TOLERANCE = 1e-5
"""Relative error of the fine eigenvalues: a hundredth of a cent."""


@dataclass(frozen=True)
class FineModes:
    """Elastic modes of the fine solid, and which coarse ones they are.

    Attributes
    ----------
    frequencies : (N,) [Hz]
        Ascending.
    order : (N,)
        Number of the coarse mode of the same shape.
    coarse : (N,) [Hz]
        Its frequency.
    excess : (T, N)
        Its balance of amplitudes at the struck points less that of the fine mode.
    cost
        Eq. (4) of the fine solid.
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
    """The solid that a coarse one stands for, its modes followed from one material to the next.

    One thread does it, as in the search: what is found does not depend on the machine's cores.

    Parameters
    ----------
    setting
        Of the search, which coarsens.
    coarse
        Its simulation.
    """

    def __init__(self, setting: Setting, coarse: Simulation) -> None:
        self._setting, self._coarse = setting, coarse
        with one_thread():
            self._simulation = setting.fine().simulation(FINE_TOLERANCE)
        self._shapes = ShapeMatch(coarse.model, self._simulation.model)
        self._last: Modes | None = None

    def modes(self, evaluation: Evaluation) -> FineModes:
        """Modes of the material that an evaluation of the coarse simulation found modes of.

        Raises
        ------
        ConvergenceError
            If there are none to be had.
        """
        simulation, setting = self._simulation, self._setting
        with one_thread():
            fine = simulation.evaluate_anyway(evaluation.z, self._last)
            self._last = fine.modes
            hertz, coarse = frequencies(fine.eigenvalues), frequencies(evaluation.eigenvalues)
            order = self._shapes.order(
                self._coarse.mesh_rows(evaluation.modes.vectors[:, RIGID_MODES:]),
                simulation.mesh_rows(fine.modes.vectors[:, RIGID_MODES:]),
            )
            cost = cost_of(setting.objective, setting.material, fine)
        balance = setting.objective.balance
        own = balance(fine.eigenvalues, fine.pushed)
        excess = balance(evaluation.eigenvalues, evaluation.pushed)[:, order] - own
        return FineModes(hertz, order, coarse[order], excess, cost)


def fine_frequencies(design: Design) -> FineFrequencies:
    """Frequencies of a design on the solid that its coarse one stands for.

    A design that was not coarsened is its own.

    Raises
    ------
    ConvergenceError
        If there are no modes to be had.
    """
    count = len(design.targets.frequencies)
    if not is_coarsened(design):
        return FineFrequencies(design.coarse_frequencies, np.arange(count))
    mesh = hexmesh_from_grid(design.fine_grid, design.fine_origin, design.fine_edge)
    model = fine_model(
        mesh, design.young, poisson=design.model.poisson, density=design.model.density
    )
    options = SolverOptions(modes=RIGID_MODES + count, tolerance=FINE_TOLERANCE)
    solver = ModalSolver(model, options, MPI.COMM_SELF)
    modes = solver.solve()
    rows = np.empty_like(modes.vectors)
    rows[degrees_of_freedom(solver.local_mesh.nodes)] = modes.vectors
    order = ShapeMatch(design.model, model).order(
        design.modes[:, RIGID_MODES:], rows[:, RIGID_MODES:]
    )
    return FineFrequencies(frequencies(modes.values[RIGID_MODES:]), order)


def is_coarsened(design: Design) -> bool:
    """Whether the solid that a design was sought on stands for a finer one."""
    mesh = design.model.mesh
    return isinstance(design.model, ElasticModel) and mesh.n_cells != len(design.young)


class ShapeMatch:
    """Which mode of a coarse solid has the shape of which one of the fine solid.

    Parameters
    ----------
    coarse, fine
        The two solids, of any moduli.
    """

    def __init__(self, coarse: Solid, fine: Solid) -> None:
        # Of a lumped mass, a cell's share a node; factors do not matter.
        self._mass = np.repeat(np.bincount(fine.connectivity.ravel()), 3)[:, None]
        self._interpolation = interpolation(coarse, fine.mesh.nodes)

    def order(self, coarse_modes: Array, fine_modes: Array) -> Index:
        """Number (N,) of the coarse mode for each fine one.

        Modes of which one shape clearly is the other's are pairs; what is left, shapes that the
        coarse solid does not have, are pairs in their order.

        Parameters
        ----------
        coarse_modes, fine_modes : (3 n, N)
            On the nodes of the two solids, by ascending frequency.
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
