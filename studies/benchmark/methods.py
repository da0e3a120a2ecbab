"""Timed runs of solvers on one solid, from moduli to modes."""

import time
from dataclasses import dataclass, field, replace
from typing import Any

from carillon.arrays import Array
from carillon.fem.model import RIGID_MODES, Solid
from carillon.processes.mpi import MPI
from solver.analysis.coarse_start import coarse_start
from solver.analysis.modal_solver import ModalSolver
from solver.analysis.modes import Modes
from solver.analysis.options import SolverOptions
from solver.assembly.system import Layout, assemble
from solver.correction.criteria import INTERACTIVE_TOLERANCE
from solver.distribution.collective import compute_on_root
from solver.distribution.local_mesh import distribute
from solver.files.modes_file import CHECKS
from solver.linear import LinearSolver
from solver.reference.truth import SPARE_MODES, can_count
from studies.benchmark.further_rivals import RIVALS, completed
from studies.benchmark.rivals import (
    SlepcConfiguration,
    smallest_without_factor,
    without_purification,
)
from studies.benchmark.search import RivalSearch
from studies.benchmark.solid import BenchmarkSolid

CORRECTED_TOLERANCE = 1e-6
"""Eigenvalue error of HCMS with error correction on the fine mesh."""
RIVAL_TOLERANCE = 1e-6
"""Relative residual of SLEPc and ARPACK; their eigenvalues are far better, at no cost."""
ROUGH_TOLERANCE = 1e-3
"""Either's, where the fine solid is wanted roughly."""
RIVAL_SECONDS = 300.0
"""Wall time [s] after which a further rival is given up."""
BELOW_ELASTIC, ABOVE_LAST = 0.5, 1.0 + 1e-4
"""Ends of the interval that rivals are told: of the first elastic and the last eigenvalue."""


@dataclass(frozen=True)
class MethodRun:
    """One run of a method."""

    seconds: float
    """Wall time from moduli to modes, without checks."""
    values: Array
    """(k,) eigenvalues found."""
    before: float = 0.0
    """Wall time [s] of what needs the mesh alone."""
    phases: dict[str, float] = field(default_factory=dict)
    """Wall time [s] by phase, checks left out."""
    added: int = 0
    """Modes that the method missed, and that were found when its result was checked."""


@dataclass
class Methods:
    """Every way to the lowest modes of one solid; all ranks call the same."""

    solid: BenchmarkSolid | None
    """On rank 0, None elsewhere."""
    modes: int
    """Number of modes, rigid ones included."""
    configuration: SlepcConfiguration
    """Of SLEPc's Krylov-Schur, wherever it is used."""
    seed: int = 0
    """Of the partition."""
    comm: MPI.Comm = field(default_factory=lambda: MPI.COMM_WORLD)
    brief: bool = False
    """Whether one correction will do, as it does to compile and load everything."""
    rival_seconds: float = RIVAL_SECONDS
    """Wall time [s] after which a further rival is given up."""
    _exact: Array | None = None
    _warm: tuple[ModalSolver, Modes] | None = None

    def general(
        self,
        package: str,
        coarsening: str = "none",
        tolerance: float = RIVAL_TOLERANCE,
        changed: bool = False,
    ) -> MethodRun:
        """Shift-and-invert by SLEPc's Krylov-Schur (`slepc`) or ARPACK (`arpack`).

        It is given the rigid motions, finds a few modes to spare, and is charged for one search.
        Modes that this missed, by the count of eigenvalues, are found by others off the clock: its
        eigenvalues are a reference, which must be complete, and its time is favoured.
        """
        slepc = package == "slepc"
        setup = self.configuration.in_force(self.modes) if slepc else without_purification()
        with setup:
            run = self.solve(coarsening, changed, method=package, tolerance=tolerance)
        if slepc and coarsening == "none" and tolerance == RIVAL_TOLERANCE:
            self._exact = run.values
        # It needs nothing of what is prepared of the mesh.
        return replace(run, before=0.0)

    def arpack_regular(self) -> MethodRun:
        """ARPACK without a factorisation, on the fine mesh with a diagonal mass."""
        model = compute_on_root(self.comm, lambda: self._root.lumped())
        begin = self._now()
        values = smallest_without_factor(model, self.modes, RIVAL_TOLERANCE, self.seed, self.comm)
        return MethodRun(self._now() - begin, values)

    def further(self, name: str) -> MethodRun:
        """One of `RIVALS`, asked for what SLEPc is asked for, on the fine mesh.

        Modes that it missed are found off the clock, see `general`.

        Raises ConvergenceError if it cannot be tried here, takes too long or fails.
        """
        rival = RIVALS[name]
        rival.require(self.comm.size)
        exact = self.general("slepc").values if self._exact is None else self._exact
        model = self._root.lumped() if rival.lumped else self._root.fine
        local_mesh = distribute(model, None, self.seed, self.comm)
        layout = Layout.of_local_mesh(local_mesh, self.comm)
        linear = LinearSolver("auto", layout)
        count = min(self.modes + (SPARE_MODES if can_count() else 0), model.n_dofs)
        begin = self._now()
        search = RivalSearch(
            assemble(local_mesh, self.comm, layout),
            linear,
            (self.modes if rival.interval else count) - RIGID_MODES,
            (BELOW_ELASTIC * exact[RIGID_MODES], ABOVE_LAST * exact[-1]),
            RIVAL_TOLERANCE,
            self.seed,
            self.rival_seconds,
        )
        try:
            pairs = rival.search(search)
            seconds = self._now() - begin
            search.check_time()  # not every search asks in between
            values, added = completed(search, pairs, self.modes)
        finally:
            search.system.destroy()
        return MethodRun(seconds, values, added=added)

    def solve(
        self,
        coarsening: str = "none",
        changed: bool = False,
        from_coarse: bool = False,
        **options: Any,
    ) -> MethodRun:
        """This project's solver with such `SolverOptions`, maybe from modes of the coarse mesh."""
        model, coarsened = self._model(coarsening, changed)
        begin = self._now()
        solver = ModalSolver(model, self._options(**options), self.comm)
        prepared = self._now()
        start = None
        if from_coarse:
            forest = None if self.solid is None else self.solid.forest
            start = coarse_start(solver, model, forest)
        result = solver.solve(initial_modes=start)
        return replace(self._run(result, prepared, coarsened), before=prepared - begin)

    def solve_warm(self) -> MethodRun:
        """The changed material on the coarse mesh, from the modes of the unchanged one."""
        if self._warm is None:
            model, _ = self._model("ddfem")
            options = self._options(tolerance=INTERACTIVE_TOLERANCE)
            solver = ModalSolver(model, options, self.comm)
            self._warm = solver, solver.solve()
        solver, start = self._warm
        model, coarsened = self._model("ddfem", changed=True)
        begin = self._now()
        result = solver.solve(None if model is None else model.young, start, coarsened=True)
        return self._run(result, begin, coarsened)

    def release(self) -> None:
        """Free what warm runs start from."""
        if self._warm is not None:
            self._warm[1].system.destroy()
            self._warm = None

    def _options(self, **changes: Any) -> SolverOptions:
        options = SolverOptions(modes=self.modes, seed=self.seed, **changes)
        if self.brief and options.method == "hcms":
            options = replace(options, tolerance=0.0, corrections=min(1, options.corrections))
        elif self.brief and options.method == "auto":
            options = replace(options, tolerance=INTERACTIVE_TOLERANCE)
        return options

    @property
    def _root(self) -> BenchmarkSolid:
        assert self.solid is not None
        return self.solid

    def _model(self, coarsening: str, changed: bool = False) -> tuple[Solid | None, float]:
        """Model on rank 0, and the seconds that coarsening took, on every rank."""
        if coarsening == "none":
            return (None if self.solid is None else self.solid.fine), 0.0
        made = compute_on_root(self.comm, lambda: self._root.coarsened(coarsening, changed))
        model, seconds = made or (None, 0.0)
        return model, self.comm.bcast(seconds)

    def _run(self, result: Modes, begin: float, coarsened: float) -> MethodRun:
        elapsed = self._now() - begin
        phases = {name: time for name, time in result.seconds.items() if name not in CHECKS}
        checking = sum(result.seconds.values()) - sum(phases.values())
        values = result.values
        result.system.destroy()
        if coarsened:
            phases = {"coarsening": coarsened, **phases}
        added = result.evidence.get("modes_added", 0)
        return MethodRun(coarsened + elapsed - checking, values, phases=phases, added=added)

    def _now(self) -> float:
        """Time at which all ranks are here."""
        self.comm.barrier()
        return time.perf_counter()
