"""Modal analysis of a model by any method, with the evidence that the result is right."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, TypeGuard, cast

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from carillon.command_line.progress import say
from carillon.fem.model import Solid
from carillon.fem.moduli import require_coarse_moduli
from carillon.processes.memory import reuse_freed_memory
from carillon.processes.threads import limit_threads
from carillon.processes.waiting import leave_cores
from solver.analysis.bounds import check_mode_count, require_memory
from solver.analysis.corrected import CorrectedModes, Eigenpairs
from solver.analysis.modes import Initial, Modes
from solver.analysis.options import RANDOM, SolverOptions
from solver.analysis.prepared import Prepared
from solver.analysis.proof import ground_truth, prove
from solver.analysis.timing import Phases
from solver.assembly.system import assemble
from solver.distribution.collective import bcast_from_root, compute_on_root, ranks_of_machine
from solver.distribution.local_mesh import distribute, scatter_moduli, with_poisson
from solver.linear import Inverse
from solver.subspace.weyl import CountingLaw

Array = NDArray[np.float64]


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
        options = bcast_from_root(comm, lambda: _with_method(options, model))
        self._model = model if comm.rank == 0 else None
        require_memory(model, options, comm)
        self.comm = comm
        self._verbose = verbose
        self._threads = limit_threads(ranks_of_machine(comm))
        leave_cores(comm)
        reuse_freed_memory()
        phases = Phases(comm, verbose)
        if options.method not in RANDOM or options.linear_solver != "auto":
            prepared = None
        with phases("partition"):
            if prepared is None:
                subdomains = comm.size if options.method in RANDOM else options.subdomains
                self.local_mesh = distribute(model, subdomains, options.seed, comm)
            else:
                self.local_mesh = prepared.local_mesh
        with phases("analysis"):
            if prepared is None:
                prepared = Prepared.of_mesh(self.local_mesh, comm, options.linear_solver)
            self._layout, self._linear = prepared.layout, prepared.linear
            if options.method == "lanczos" and not self._linear.indefinite:
                options = replace(options, method="lobpcg")
            report = _reporter(verbose and comm.rank == 0)
            self._corrected = CorrectedModes(
                options, self.local_mesh, self._linear, comm, self._threads, report
            )
        self.options = options
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
        options, phases = self.options, Phases(self.comm, self._verbose)
        with phases("assembly"):
            local_mesh = self.local_mesh
            if self.comm.bcast(young is not None):
                moduli = compute_on_root(
                    self.comm, lambda: moduli_of(cast(Solid, self._model), cast(Array, young))
                )
                local_mesh = scatter_moduli(local_mesh, moduli, self.comm)
            if poisson is not None:
                local_mesh = with_poisson(local_mesh, poisson)
            similar = initial_modes if self._is_of_same_mesh(initial_modes) else None
            like = None if similar is None else similar.system
            elements = local_mesh.cells.elements
            system = assemble(local_mesh, self.comm, self._layout, elements, self._threads, like)
        evidence: dict[str, Any] = {
            "method": options.method,
            "ranks": self.comm.size,
            "threads": self._threads,
            "subdomains": local_mesh.decomposition.tree.parts,
            "n_dofs": local_mesh.n_dofs,
        }
        if options.is_general:
            pairs = Eigenpairs(*ground_truth(system, options, phases, evidence).lowest())
        else:
            law = partial(self._law, young)
            pairs = self._corrected.solve(
                local_mesh, system, initial_modes, similar is not None, law, phases, evidence
            )
        exact = options.is_general or options.is_corrected
        residuals = prove(system, pairs.values, pairs.vectors, exact, phases, evidence)
        return Modes(
            pairs.values,
            pairs.vectors,
            residuals,
            system,
            evidence,
            phases.seconds,
            pairs.guard,
            pairs.inverse,
        )

    def inverse(self, modes: Modes, shift: float) -> Inverse:
        """(K - shift M)^-1 of the material that `modes` belong to, by the correction's solver."""
        return self._linear.inverse(modes.system, shift)

    def _is_of_same_mesh(self, initial_modes: Initial | None) -> TypeGuard[Modes]:
        """Whether these are modes that this solver found."""
        if not isinstance(initial_modes, Modes):
            return False
        return initial_modes.system.rows.pattern is self._layout.pattern

    def _law(self, young: Array | None) -> CountingLaw:
        """Where the eigenvalues are expected, on every rank."""

        def law() -> CountingLaw:
            model = cast(Solid, self._model)
            moduli = model.young if young is None else young
            return CountingLaw.of_solid(model, moduli, self.options.modes)

        return bcast_from_root(self.comm, law)


def _with_method(options: SolverOptions, model: Solid | None) -> SolverOptions:
    n_dofs = cast(Solid, model).n_dofs
    check_mode_count(options.modes, n_dofs)
    return options.with_method(n_dofs)


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
