"""Modal analysis of a model by any method, with the evidence that the result is right."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, TypeGuard, cast

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from carillon.command_line.progress import say
from carillon.fem.model import RIGID_MODES, Solid
from carillon.fem.moduli import require_coarse_moduli
from carillon.processes.memory import reuse_freed_memory
from carillon.processes.threads import limit_threads
from carillon.processes.waiting import leave_cores
from solver.analysis.bounds import check_mode_count, require_memory
from solver.analysis.components import ComponentModes, elastic_part, lowest_pairs
from solver.analysis.modes import Initial, Modes
from solver.analysis.options import RANDOM, SolverOptions
from solver.analysis.prepared import Prepared
from solver.analysis.proof import completed, ground_truth
from solver.analysis.timing import Phases, peak_memory
from solver.assembly.system import Layout, System, assemble
from solver.correction.correct import correct
from solver.correction.correction import EIGENVALUE_TOLERANCE, carried, resolved
from solver.correction.random_start import Approximation, Cold, from_nothing
from solver.distribution.collective import bcast_from_root, compute_on_root, ranks_of_machine
from solver.distribution.local_mesh import LocalMesh, distribute, scatter_moduli, with_poisson
from solver.linear import Inverse, Lasting, LinearSolver
from solver.reference.truth import SPARE_MODES, Truth, can_count
from solver.subspace.rayleigh_ritz import rigid_pairs
from solver.subspace.weyl import CountingLaw
from solver.verification.residuals import (
    require_orthonormal,
    require_six_rigid,
    rigid_modes,
    verify,
)

Array = NDArray[np.float64]

FEWEST_CORRECTED = 6
"""Modes that HCMS corrects at least: the first mode of a ball alone, one of five that are all but
equal, hardly converges."""


@dataclass
class _Solution:
    """Eigenpairs, and what a warm start makes use of, see `Modes`."""

    values: Array
    vectors: Array
    guard: Array | None = None
    inverse: Lasting | None = None


class ModalSolver:
    """Modes of one mesh for any material on it.

    Parameters
    ----------
    model
        The solid; only rank 0's is looked at, and scattered to the others, who may pass None.
    options
        What to compute and how.
    comm
        Ranks that share the work.
    verbose
        Whether to show each phase and its time.
    prepared
        Partition and analysis of the same mesh, of use to methods that begin with random vectors.

    Attributes
    ----------
    local_mesh
        This rank's part of the solid.
    seconds
        Wall time of what depends on the mesh alone, by phase.

    Raises
    ------
    UserError
        If more modes are wanted than there are unknowns or than memory can hold, or there are more
        ranks than subdomains.

    Examples
    --------
    A material that changes little by little is followed from one solution to the next::

        solver = ModalSolver(model, SolverOptions(modes=60, tolerance=1e-2))
        modes = solver.solve()
        modes = solver.solve(young, initial_modes=modes)
    """

    def __init__(
        self,
        model: Solid | None,
        options: SolverOptions,
        comm: MPI.Comm = MPI.COMM_WORLD,
        verbose: bool = False,
        prepared: Prepared | None = None,
    ) -> None:
        def checked() -> SolverOptions:
            n_dofs = cast(Solid, model).n_dofs
            check_mode_count(options.modes, n_dofs)
            return options.resolved(n_dofs)

        options = bcast_from_root(comm, checked)
        self._model = model if comm.rank == 0 else None
        require_memory(model, options, comm)
        self.options = options
        self.comm = comm
        self._verbose = verbose
        self._threads = limit_threads(ranks_of_machine(comm))
        leave_cores(comm)
        reuse_freed_memory()
        phases = Phases(comm, verbose)
        if options.method not in RANDOM or options.linear_solver != "auto":
            prepared = None
        with phases("partition"):
            subdomains = comm.size if options.method in RANDOM else options.subdomains
            if prepared is None:
                self.local_mesh = distribute(model, subdomains, options.seed, comm)
            else:
                self.local_mesh = prepared.local_mesh
        with phases("analysis"):
            if prepared is None:
                self._layout = Layout.of_local_mesh(self.local_mesh, comm)
                self._linear = LinearSolver(options.linear_solver, self._layout)
            else:
                self._layout, self._linear = prepared.layout, prepared.linear
            if options.method == "lanczos" and not self._linear.indefinite:
                self.options = options = replace(options, method="lobpcg")
            if options.method == "hcms":
                self._components = ComponentModes(self.local_mesh, options, self._together, comm)
        self.seconds = phases.seconds

    def solve(
        self,
        young: Array | None = None,
        initial_modes: Initial | None = None,
        poisson: float | None = None,
    ) -> Modes:
        """Compute the lowest modes.

        All ranks call it and get the same values.

        Parameters
        ----------
        young
            Young's modulus [Pa] as `Solid.with_young` takes it, (m,) of the voxels for example, on
            rank 0; that of the model if not given.
        initial_modes
            Modes of a similar material on the same mesh, or this rank's rows (local, k) of such,
            or those of a coarser mesh, see `solver.analysis.coarse_start`: they are corrected.
        poisson
            Poisson's ratio, the same on every rank; that of the model if not given.

        Raises
        ------
        UserError
            For what `Solid.element_moduli` refuses.
        ConvergenceError
            If a tolerance was missed, the modes are not orthonormal, or the body does not have six
            zero-frequency modes.
        """
        return self._solve(
            young, initial_modes, poisson, lambda model, given: model.element_moduli(given)
        )

    def solve_coarse(
        self,
        moduli: Array | None,
        initial_modes: Initial | None = None,
        poisson: float | None = None,
    ) -> Modes:
        """The same with the moduli (m, 8) [Pa] that a coarsening made, on rank 0.

        They may lie beyond the limits of those that users give.

        Raises
        ------
        UserError
            For what `carillon.fem.moduli.require_coarse_moduli` refuses.
        ConvergenceError
            See `solve`.
        """
        return self._solve(
            moduli,
            initial_modes,
            poisson,
            lambda model, given: require_coarse_moduli(given, model.mesh.n_cells),
        )

    def _solve(
        self,
        young: Array | None,
        initial_modes: Initial | None,
        poisson: float | None,
        moduli_of: Callable[[Solid, Array], Array],
    ) -> Modes:
        phases = Phases(self.comm, self._verbose)
        with phases("assembly"):
            local_mesh = self.local_mesh
            if self.comm.bcast(young is not None):
                moduli = compute_on_root(
                    self.comm, lambda: moduli_of(cast(Solid, self._model), cast(Array, young))
                )
                local_mesh = scatter_moduli(local_mesh, moduli, self.comm)
            if poisson is not None:
                local_mesh = with_poisson(local_mesh, poisson)
            elements = local_mesh.cells.elements
            like = initial_modes.system if self._is_of_same_mesh(initial_modes) else None
            system = assemble(local_mesh, self.comm, self._layout, elements, self._threads, like)
        evidence: dict[str, Any] = {
            "method": self.options.method,
            "ranks": self.comm.size,
            "threads": self._threads,
            "subdomains": local_mesh.decomposition.tree.parts,
            "n_dofs": local_mesh.n_dofs,
        }
        if self.options.is_general:
            truth = ground_truth(system, self.options, phases, evidence)
            solution = _Solution(*truth.lowest())
        else:
            solution = self._corrected(local_mesh, system, young, initial_modes, phases, evidence)
        values, vectors = solution.values, solution.vectors
        with phases("verification"):
            residuals, orthogonality = verify(system, values, vectors)
        evidence["orthogonality"] = orthogonality
        evidence["residual_max"] = float(residuals.max())
        evidence["rigid_modes"] = rigid_modes(system, values, vectors)
        evidence["peak_memory_bytes"] = peak_memory(self.comm)
        require_orthonormal(orthogonality)
        if self._exact:
            require_six_rigid(evidence["rigid_modes"])
        return Modes(
            values,
            vectors,
            residuals,
            system,
            evidence,
            phases.seconds,
            solution.guard,
            solution.inverse,
        )

    def inverse(self, modes: Modes, shift: float) -> Inverse:
        """(K - shift M)^-1 of the material that `modes` belong to, by the correction's solver."""
        return self._linear.inverse(modes.system, shift)

    @property
    def _exact(self) -> bool:
        """Whether eigenpairs are asked for, not just approximations of them."""
        return self.options.is_general or self.options.is_corrected

    @property
    def _together(self) -> bool:
        """Whether a block Lanczos iteration corrects all modes together."""
        return self.options.acceleration == "lanczos" and self._linear.indefinite

    def _is_of_same_mesh(self, initial_modes: Initial | None) -> TypeGuard[Modes]:
        """Whether these are modes that this solver found."""
        if not isinstance(initial_modes, Modes):
            return False
        return initial_modes.system.rows.pattern is self._layout.pattern

    def _corrected(
        self,
        local_mesh: LocalMesh,
        system: System,
        young: Array | None,
        initial_modes: Initial | None,
        phases: Phases,
        evidence: dict[str, Any],
    ) -> _Solution:
        options = self.options
        requested = options.modes - RIGID_MODES
        if options.check_inertia:
            requested = min(requested + SPARE_MODES, local_mesh.n_dofs - RIGID_MODES)
        tolerance = EIGENVALUE_TOLERANCE if options.tolerance is None else options.tolerance
        values: Array | None = None
        similar: Lasting | None = None
        cold: Cold | None = None
        near: Approximation | None = None
        if isinstance(initial_modes, Modes):
            if self._is_of_same_mesh(initial_modes):
                similar = initial_modes.inverse
            start: Array | None = initial_modes.start()
        elif isinstance(initial_modes, Approximation):
            near, start = initial_modes, initial_modes.vectors
        else:
            start = initial_modes
        if (start is None and options.method == "lanczos") or (near is not None and self._together):
            with phases("lanczos"):
                cold = from_nothing(
                    system,
                    self._linear,
                    requested,
                    resolved(requested, tolerance),
                    carried(requested, tolerance),
                    self._law(young),
                    tolerance,
                    options.seed,
                    near,
                )
            values, start = cold.found.values, cold.found.vectors
        elif start is None and options.method == "hcms":
            with phases("hcms"):
                synthesis = self._components.synthesis(local_mesh, self._threads, evidence)
            if options.corrections == 0:
                return _Solution(*lowest_pairs(synthesis, options.modes))
            values, start = elastic_part(system, synthesis)
            requested = max(requested, min(FEWEST_CORRECTED, start.shape[1]))
        with phases("correction"):
            result = correct(
                system,
                start,
                requested,
                self._linear,
                values,
                tolerance,
                options.corrections,
                options.acceleration,
                report=_reporter(self._verbose and self.comm.rank == 0),
                similar=similar,
                begun=cold,
                keep=options.keeps_missed,
            )
            cold = start = None  # a factorisation, and a copy of the modes
            rigid_values, rigid = rigid_pairs(system)
        reached = float(result.errors[: options.modes - RIGID_MODES].max())
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
        if options.check_inertia and can_count():
            count = self._linear.count_below
            truth = completed(system, truth, options, phases, evidence, count)
            evidence |= {"further_searches": truth.searches, "modes_added": truth.added}
        return _Solution(*truth.lowest(), result.guard, result.inverse)

    def _law(self, young: Array | None) -> CountingLaw:
        """Where the eigenvalues are expected, on every rank."""

        def law() -> CountingLaw:
            model = cast(Solid, self._model)
            moduli = model.young if young is None else young
            return CountingLaw.of_solid(model, moduli, self.options.modes)

        return bcast_from_root(self.comm, law)


def modal_analysis(
    model: Solid | None,
    options: SolverOptions,
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> Modes:
    """Compute the lowest modes of `model` once, see `ModalSolver`.

    The seconds of the result hold those of the preparation too.
    """
    prepared = ModalSolver(model, options, comm)
    modes = prepared.solve()
    return replace(modes, seconds={**prepared.seconds, **modes.seconds})


def _reporter(visible: bool) -> Callable[[int, float], None] | None:
    if not visible:
        return None
    return lambda step, worst: say(f"  after {step} corrections: eigenvalue error {worst:.1e}")
