"""Modal analysis of a model by any method, with the evidence that the result is right."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeGuard, cast

import numpy as np

from carillon.arrays import Array
from carillon.command_line.progress import say
from carillon.errors import ConvergenceError
from carillon.fem.model import ElasticModel, Solid
from carillon.fem.moduli import require_coarse_moduli
from carillon.fem.regions import Regions
from carillon.processes.memory import reuse_freed_memory
from carillon.processes.mpi import MPI
from carillon.processes.waiting import leave_cores
from solver.analysis.bounds import check_mode_count, require_memory
from solver.analysis.components import distribute_by_parts
from solver.analysis.corrected import CorrectedModes, Eigenpairs
from solver.analysis.faster_method import gradients_are_faster
from solver.analysis.modes import Initial, Modes
from solver.analysis.options import AUTO, RANDOM, SolverOptions
from solver.analysis.phases import Phases, RankClock
from solver.analysis.proof import ground_truth, prove
from solver.assembly.system import Layout, System, assemble
from solver.distribution.collective import bcast_from_root, compute_on_root, share_cores
from solver.distribution.local_mesh import LocalMesh, distribute, scatter_moduli, with_regions
from solver.linear import Inverse, LinearSolver
from solver.subspace.weyl import CountingLaw


class ModalSolver:
    """Modes of one mesh for any material on it.

    Its `seconds` are the wall time of what depends on the mesh alone, by phase. Raises UserError if
    more modes are wanted than there are unknowns or than memory can hold, or there are more ranks
    than subdomains.

    Parameters
    ----------
    model
        The solid; only rank 0's is looked at, and scattered to the others, who may pass None.
    options
        What to compute and how.
    prepared
        Partition and analysis of the same mesh, of use to methods that begin with random vectors.
    once
        Whether only one material will be solved for: then `auto` takes conjugate gradients, which
        keep nothing for a next one, where they are faster.
    from_coarse
        Whether they will be given coarse modes to start from.
    clock
        Clock of the run, to which the phases are added, if there is one.

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
        clock: RankClock | None = None,
        once: bool = False,
        from_coarse: bool = False,
    ) -> None:
        once = once and prepared is None and options.method == options.linear_solver == AUTO
        options = bcast_from_root(comm, lambda: _with_method(options, model))
        once = once and bcast_from_root(comm, lambda: isinstance(model, ElasticModel))
        self._model = model if comm.rank == 0 else None
        require_memory(model, options, comm)
        self.comm = comm
        self._verbose = verbose
        self._clock = clock
        self._threads = share_cores(comm)
        leave_cores(comm)
        reuse_freed_memory()
        phases = Phases(comm, verbose, clock)
        if options.method not in RANDOM or options.linear_solver != "auto":
            prepared = None
        with phases("partition"):
            if prepared is not None:
                self._by_parts = self.local_mesh = prepared.local_mesh
            elif options.method in RANDOM:
                self._by_parts = self.local_mesh = distribute(model, comm=comm, by_planes=True)
            else:
                self._by_parts, self.local_mesh = distribute_by_parts(model, options, comm)
        with phases("analysis"):
            if prepared is None:
                uncorrected = options.method == "hcms" and options.corrections == 0
                prepare = Prepared.without_analysis if uncorrected else Prepared.of_mesh
                prepared = prepare(self.local_mesh, comm, options.linear_solver)
            self._layout, self._linear = prepared.layout, prepared.linear
            self._is_by_choice = False
            if options.method == "lanczos" and not self._linear.indefinite:
                options = replace(options, method="lobpcg")
            elif once and options.method == "lanczos":
                size = self._linear.tree, self.local_mesh.n_dofs
                self._is_by_choice = gradients_are_faster(*size, options, from_coarse)
            self._correct_by("lobpcg" if self._is_by_choice else options.method, options)
        self.seconds = phases.seconds

    def _correct_by(self, method: str, options: SolverOptions) -> None:
        """Correct modes by a method, which `lobpcg` does without a factorisation."""
        self.options = replace(options, method=method)
        linear = self._linear.by("amg-cg") if self._is_by_choice else self._linear
        report = _reporter(self._verbose and self.comm.rank == 0)
        self._corrected = CorrectedModes(
            self.options,
            self._by_parts,
            self.local_mesh,
            linear,
            self.comm,
            self._threads,
            report,
        )

    def solve(
        self,
        young: Array | None = None,
        initial_modes: Initial | None = None,
        regions: Regions | None = None,
        coarsened: bool = False,
    ) -> Modes:
        """Compute the lowest modes.

        All ranks call it and get the same values. Raises UserError for what `Solid.element_moduli`
        or `require_coarse_moduli` refuses, and ConvergenceError if a tolerance was missed, the
        modes are not orthonormal, or the body does not have six zero-frequency modes.

        Parameters
        ----------
        young
            Young's modulus [Pa] as `Solid.with_young` takes it, (m,) of the voxels for example, on
            rank 0; that of the model if not given.
        initial_modes
            Modes of a similar material on the same mesh, or this rank's rows (local, k) of such,
            or those of a coarser mesh, see `solver.analysis.coarse_start`: they are corrected.
        regions
            Materials in place of the model's, in their order and the same on every rank.
        coarsened
            Whether `young` (m, 8) is what a coarsening made, which may lie beyond the limits of
            moduli that users give.
        """
        options, phases = self.options, Phases(self.comm, self._verbose, self._clock)
        with phases("assembly"):
            moduli, changed = None, self.comm.bcast(young is not None)
            if changed:
                moduli = compute_on_root(
                    self.comm, lambda: self._moduli(cast(Array, young), coarsened)
                )

            def of_material(local_mesh: LocalMesh) -> LocalMesh:
                if changed:
                    local_mesh = scatter_moduli(local_mesh, moduli, self.comm)
                return local_mesh if regions is None else with_regions(local_mesh, regions)

            local_mesh = of_material(self.local_mesh)

            def by_parts() -> LocalMesh:
                same = self._by_parts is self.local_mesh
                return local_mesh if same else of_material(self._by_parts)

            similar = initial_modes if self._is_of_same_mesh(initial_modes) else None
            elements = local_mesh.cells.elements
            density = elements.regions.density
            same_mass = similar is not None and np.array_equal(similar.density, density)
            like = similar.system if similar is not None and same_mass else None
            system = assemble(local_mesh, self.comm, self._layout, elements, self._threads, like)
        evidence: dict[str, Any] = {
            "method": options.method,
            "ranks": self.comm.size,
            "threads": self._threads,
            "subdomains": self._by_parts.decomposition.tree.parts,
            "n_dofs": local_mesh.n_dofs,
        }
        if options.is_general:
            pairs = Eigenpairs(*ground_truth(system, options, phases, evidence).lowest())
        else:
            law = partial(self._law, young)
            arguments = initial_modes, similar is not None, law, phases, evidence
            try:
                pairs = self._corrected.solve(by_parts, system, *arguments)
            except ConvergenceError as error:
                if not error.collective or not (self._is_by_choice or initial_modes is not None):
                    raise
                if self._is_by_choice:
                    self._factorise_after(error)
                    evidence["method"] = self.options.method
                else:
                    self._say("the given modes are too far off; modes are sought anew")
                    arguments = None, False, law, phases, evidence
                pairs = self._corrected.solve(by_parts, system, *arguments)
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
            density,
        )

    def _factorise_after(self, error: ConvergenceError) -> None:
        """Go on with a factorisation where the choice of conjugate gradients was a bad one."""
        self._say(f"{error}; a factorisation is made")
        self._is_by_choice = False
        self._correct_by("lanczos", self.options)

    def _say(self, sentence: str) -> None:
        say(sentence, visible=self.comm.rank == 0)

    def _moduli(self, young: Array | None, coarsened: bool) -> Array:
        model, young = cast(Solid, self._model), cast(Array, young)
        if coarsened:
            return require_coarse_moduli(young, model.mesh.n_cells)
        return model.element_moduli(young)

    def inverse(self, modes: Modes, shift: float) -> Inverse:
        """(K - shift M)^-1 of the material that `modes` belong to, by the correction's solver."""
        return self._linear.inverse(modes.system, shift)

    def _is_of_same_mesh(self, initial_modes: Initial | None) -> TypeGuard[Modes]:
        if not isinstance(initial_modes, Modes):
            return False
        return initial_modes.system.rows.pattern is self._layout.pattern

    def _law(self, young: Array | None) -> CountingLaw:
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
    model: Solid | None, options: SolverOptions, comm: MPI.Comm = MPI.COMM_WORLD
) -> Modes:
    """Compute the lowest modes of `model` once, see `ModalSolver`.

    The seconds of the result hold those of the preparation too.
    """
    prepared = ModalSolver(model, options, comm, once=True)
    modes = prepared.solve()
    return replace(modes, seconds={**prepared.seconds, **modes.seconds})


def _reporter(visible: bool) -> Callable[[int, float], None] | None:
    if not visible:
        return None
    return lambda step, worst: say(f"  after {step} corrections: eigenvalue error {worst:.1e}")


@dataclass(frozen=True)
class Prepared:
    """Partition and symbolic analysis of a mesh, one subdomain a rank."""

    local_mesh: LocalMesh
    layout: Layout
    linear: LinearSolver
    """Layout of its matrices, and the solver of linear systems with them."""

    @classmethod
    def of_model(cls, model: Solid | None, comm: MPI.Comm) -> Prepared:
        """Prepare a model, which is None except on rank 0; collective."""
        return cls.of_mesh(distribute(model, comm=comm, by_planes=True), comm)

    @classmethod
    def of_mesh(
        cls, local_mesh: LocalMesh, comm: MPI.Comm, linear_solver: str = "auto"
    ) -> Prepared:
        """Prepare a mesh that is distributed; collective."""
        prepared = cls.without_analysis(local_mesh, comm, linear_solver)
        prepared.linear.method  # noqa: B018
        return prepared

    @classmethod
    def without_analysis(
        cls, local_mesh: LocalMesh, comm: MPI.Comm, linear_solver: str = "auto"
    ) -> Prepared:
        """The same, but for what linear systems alone need, which is made for the first one."""
        layout = Layout.of_local_mesh(local_mesh, comm)
        return cls(local_mesh, layout, LinearSolver(linear_solver, layout))

    def assembled(self, threads: int = 1) -> System:
        """Stiffness and mass."""
        elements = self.local_mesh.cells.elements
        return assemble(self.local_mesh, self.layout.comm, self.layout, elements, threads)
