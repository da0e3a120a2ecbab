"""Corrected modes: from random vectors, HCMS, or the modes of a similar or a coarser solid."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from carillon.arrays import Array
from carillon.processes.mpi import MPI
from solver.analysis.components import ComponentModes, elastic_part, lowest_pairs
from solver.analysis.modes import Initial, Modes
from solver.analysis.options import SolverOptions
from solver.analysis.phases import Phases
from solver.analysis.proof import completed
from solver.assembly.system import System
from solver.correction.criteria import EIGENVALUE_TOLERANCE, accurate_count, carried_count
from solver.correction.error_correction import correct
from solver.correction.random_start import Approximation, LanczosStart, from_nothing
from solver.distribution.local_mesh import LocalMesh
from solver.linear import Lasting, LinearSolver
from solver.reference.single_precision import count_below
from solver.reference.truth import SPARE_MODES, Truth
from solver.subspace.rayleigh_ritz import rigid_pairs
from solver.subspace.weyl import CountingLaw

FEWEST_CORRECTED = 6
"""Least number of modes that are corrected after HCMS. The first mode of a ball alone, one of five
nearly equal ones, hardly converges."""


@dataclass
class Eigenpairs:
    """Eigenpairs, rigid ones included, and what a warm start makes use of, see `Modes`."""

    values: Array
    vectors: Array
    guard: Array | None = None
    inverse: Lasting | None = None


@dataclass
class _Start:
    values: Array | None
    vectors: Array | Callable[[], Array] | None
    similar: Lasting | None = None
    begun: LanczosStart | None = None


class CorrectedModes:
    """Corrected modes of one mesh, for any material on it.

    HCMS has it `by_parts`, in subdomains; all else has the rows of `local_mesh`.
    `report` is called on each rank with the step and the largest estimated error.
    """

    def __init__(
        self,
        options: SolverOptions,
        by_parts: LocalMesh,
        local_mesh: LocalMesh,
        linear: LinearSolver,
        comm: MPI.Comm,
        threads: int,
        report: Callable[[int, float], None] | None,
    ) -> None:
        self._options = options
        self._linear = linear
        self._threads = threads
        self._report = report
        self._components: ComponentModes | None = None
        if options.method == "hcms":
            together = options.is_corrected and self._together
            self._components = ComponentModes(by_parts, local_mesh, options, together, comm)

    @property
    def _together(self) -> bool:
        return self._options.acceleration == "lanczos" and self._linear.indefinite

    def solve(
        self,
        by_parts: Callable[[], LocalMesh],
        system: System,
        initial: Initial | None,
        same_mesh: bool,
        law: Callable[[], CountingLaw],
        phases: Phases,
        evidence: dict[str, Any],
    ) -> Eigenpairs:
        """Modes of the material of `system`, which `by_parts` gives to subdomains; collective.

        They start from `initial`, which may be modes that were found on this `same_mesh`.
        """
        options, tolerance = self._options, self._options.tolerance
        tolerance = EIGENVALUE_TOLERANCE if tolerance is None else tolerance
        requested = options.modes - system.n_rigid
        if options.check_inertia:
            requested = min(requested + SPARE_MODES, system.n_dofs - system.n_rigid)
            # Said now, rather than once the modes are there, and lost.
            self._linear.tree.require_count(8 * requested * len(system.rigid))
        near = initial if isinstance(initial, Approximation) else None
        if (initial is None and options.method == "lanczos") or (near and self._together):
            with phases("lanczos"):
                start = self._from_nothing(system, requested, tolerance, law(), near)
        elif initial is None and self._components is not None:
            with phases("hcms"):
                synthesis = self._components.synthesis(by_parts(), self._threads, evidence)
            if options.corrections == 0:
                return Eigenpairs(*lowest_pairs(synthesis, options.modes))
            values, vectors = elastic_part(system, synthesis)
            start = _Start(values, vectors)
            requested = max(requested, min(FEWEST_CORRECTED, vectors.shape[1]))
        else:
            start = _given(initial, same_mesh)
        with phases("correction"):
            result = correct(
                system,
                start.vectors,
                requested,
                self._linear,
                start.values,
                tolerance,
                options.corrections,
                options.acceleration,
                report=self._report,
                similar=start.similar,
                begun=start.begun,
                keep=options.keeps_missed,
            )
            del start  # a factorisation, and a copy of the modes
            rigid_values, rigid = rigid_pairs(system)
        reached = float(result.errors[: options.modes - system.n_rigid].max())
        evidence |= {
            "linear_solver": self._linear.method,
            "corrections": result.steps,
            "right_hand_sides": result.solves,
            "eigenvalue_error_estimate": reached,
        }
        if options.keeps_missed and reached > tolerance > 0.0:
            evidence["missed_tolerance"] = tolerance
        truth = Truth(
            np.concatenate([rigid_values, result.values]),
            np.concatenate([rigid, result.vectors], axis=1),
            options.modes,
            result.steps,
        )
        if options.check_inertia:
            count = partial(count_below, self._linear)
            truth = completed(system, truth, options, phases, evidence, count)
            evidence |= {"further_searches": truth.searches, "modes_added": truth.added}
        return Eigenpairs(*truth.lowest(), result.guard, result.inverse)

    def _from_nothing(
        self,
        system: System,
        requested: int,
        tolerance: float,
        law: CountingLaw,
        near: Approximation | None,
    ) -> _Start:
        begun = from_nothing(
            system,
            self._linear,
            requested,
            accurate_count(requested, tolerance),
            carried_count(requested, tolerance),
            law,
            tolerance,
            self._options.seed,
            near,
        )
        return _Start(begun.result.values, begun.result.vectors, begun=begun)


def _given(initial: Initial | None, same_mesh: bool) -> _Start:
    if isinstance(initial, Modes):
        return _Start(None, initial.start(), initial.inverse if same_mesh else None)
    return _Start(None, initial.vectors if isinstance(initial, Approximation) else initial)
