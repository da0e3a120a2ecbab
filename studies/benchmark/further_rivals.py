"""Further general eigensolvers by name, each as an expert would set it up; on one rank."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib import import_module

import numpy as np

from carillon.errors import ConvergenceError, one_line
from carillon.fem.model import RIGID_MODES
from carillon.processes.mpi import MPI
from carillon.processes.petsc import PETSc
from carillon.processes.slepc import SLEPc
from solver.reference.truth import Truth, can_count, complete, count_beyond
from solver.subspace.rayleigh_ritz import rigid_pairs
from studies.benchmark import python_rivals, slepc_rivals
from studies.benchmark.search import Array, Pairs, RivalSearch

REQUIREMENTS = "workflow/envs/requirements-rivals.txt"


class UnavailableError(ConvergenceError):
    """A rival that cannot be tried here; told like one that fails."""


def require_packages(*packages: str) -> None:
    """Raise UnavailableError unless optional Python packages can be loaded."""
    for package in packages:
        try:
            import_module(package)
        except (ImportError, OSError) as error:  # OSError: a library that it needs.
            raise UnavailableError(
                f"{package} cannot be loaded ({one_line(str(error))}); install it by pip "
                f"install -r {REQUIREMENTS}"
            ) from None


@dataclass(frozen=True)
class FurtherRival:
    """A general eigensolver."""

    meaning: str
    """What it is, for the row."""
    search: Callable[[RivalSearch], Pairs]
    """Finds the elastic pairs asked for, or raises ConvergenceError."""
    packages: tuple[str, ...] = ()
    """Optional Python packages that it needs."""
    eps_type: str | None = None
    """SLEPc's eigensolver that it is, which may not be built in."""
    interval: bool = False
    """Whether it finds what is in an interval, and no number of pairs."""
    lumped: bool = False
    """Whether it needs a diagonal mass."""

    def require(self, ranks: int) -> None:
        """Raise UnavailableError unless it runs here."""
        if ranks > 1:
            raise UnavailableError(f"runs on one rank, not on {ranks}")
        require_packages(*self.packages)
        if self.eps_type is not None:
            solver = SLEPc.EPS().create(MPI.COMM_SELF)
            try:
                solver.setType(self.eps_type)
            except PETSc.Error:
                raise UnavailableError(f"this SLEPc was built without {self.eps_type}") from None
            finally:
                solver.destroy()


def _slepc(kind: str, meaning: str, interval: bool = False, lumped: bool = False) -> FurtherRival:
    search = partial(slepc_rivals.solve, kind)
    return FurtherRival(meaning, search, eps_type=kind, interval=interval, lumped=lumped)


_TOLD = "for an interval that it is told"
RIVALS = {
    "scipy_superlu": FurtherRival(
        "ARPACK by SciPy in shift-and-invert mode, factorised by SuperLU",
        python_rivals.arpack_superlu,
    ),
    "scipy_pardiso": FurtherRival(
        "the same, factorised by MKL's PARDISO", python_rivals.arpack_pardiso, ("pypardiso",)
    ),
    "scipy_lobpcg": FurtherRival(
        "LOBPCG by SciPy, preconditioned by PyAMG's smoothed aggregation",
        python_rivals.lobpcg_multigrid,
        ("pyamg",),
    ),
    "primme_direct": FurtherRival(
        "PRIMME's block Davidson method (GD+k), preconditioned by Carillon's own factorisation",
        python_rivals.davidson_direct,
        ("primme",),
    ),
    "primme_multigrid": FurtherRival(
        "the same, preconditioned by PyAMG's smoothed aggregation",
        python_rivals.davidson_multigrid,
        ("primme", "pyamg"),
    ),
    "slepc_lobpcg": _slepc(
        "lobpcg", "LOBPCG by SLEPc, preconditioned by a sparse Cholesky factorisation"
    ),
    "slepc_gd": _slepc("gd", "generalised Davidson by SLEPc, preconditioned likewise"),
    "slepc_jd": _slepc("jd", "Jacobi-Davidson by SLEPc, preconditioned likewise"),
    "slepc_ciss": _slepc(
        "ciss", "contour integrals by SLEPc over an interval that it is told", interval=True
    ),
    "slepc_filter": _slepc(
        "krylovschur", f"Krylov-Schur by SLEPc with a polynomial filter {_TOLD}", True, True
    ),
    "slepc_evsl": _slepc("evsl", f"filtered Lanczos by EVSL {_TOLD}", True, True),
}
"""Rivals in the order of the table."""
ALL = "all"
"""Stands for every one of them."""


def completed(search: RivalSearch, pairs: Pairs, modes: int) -> tuple[Array, int]:
    """Lowest eigenvalues (modes,), and the number of those that a rival had missed.

    What it found is judged by the count of eigenvalues, and others find what it lacks.

    Raises ConvergenceError if it found too few, or some of its values are no eigenvalues.
    """
    if RIGID_MODES + len(pairs[0]) < modes:
        raise ConvergenceError(f"found {RIGID_MODES + len(pairs[0])} of {modes} modes")
    system = search.system
    values, vectors = rigid_pairs(system)
    truth = Truth(
        np.concatenate([values, pairs[0]]),
        np.concatenate([vectors, search.scale[:, None] * pairs[1]], axis=1),
        modes,
        0,
    )
    inertia = count_beyond(system, truth) if can_count() else None
    if inertia is None or inertia.counted != inertia.computed:
        truth, _ = complete(system, truth, inertia, search.tolerance, search.seed)
    return truth.values[:modes], truth.added
