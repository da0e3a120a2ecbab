"""General eigensolvers in shift-and-invert mode: SLEPc's, and SciPy's where there is no SLEPc."""

import numpy as np

from carillon.arrays import Array
from carillon.errors import UserError, on_all_ranks
from carillon.processes import extras
from carillon.processes.extras import SLEPC
from solver.assembly.system import System

KRYLOV_SCHUR, ARPACK = "slepc", "arpack"
TYPES = (KRYLOV_SCHUR, ARPACK)
"""Methods: Krylov-Schur, which is SLEPc's, and ARPACK, which SciPy has, too."""


def installed_method() -> str:
    """Krylov-Schur where SLEPc is installed, ARPACK elsewhere."""
    return KRYLOV_SCHUR if extras.is_installed(SLEPC) else ARPACK


def require_method(method: str) -> None:
    """Raise UserError unless a method is installed."""
    if method == KRYLOV_SCHUR:
        extras.require(SLEPC, f"--method {method}", f"take --method {ARPACK}")


def smallest_eigenpairs(
    system: System,
    known: Array,
    count: int,
    shift: float,
    start: Array,
    tolerance: float,
    method: str = KRYLOV_SCHUR,
    configurable: bool = True,
) -> tuple[Array, Array, int]:
    """Eigenpairs of K x = lambda M x that are M-orthogonal to known ones, lowest eigenvalues first.

    The Krylov space of one vector holds one vector of every eigenspace, and more by rounding alone:
    copies of a multiple eigenvalue may be missed.

    Returns values (k,) ascending, vectors (local, k), outer iterations; k may be smaller than
    `count`, which is for the caller to judge.  The vectors are M-orthonormal but for copies of a
    multiple eigenvalue, which are so to the tolerance. Raises UserError if the method is not
    installed.

    Parameters
    ----------
    system
        K positive semidefinite, M positive definite.
    known
        (local, k) M-orthonormal eigenvectors.
    shift
        Positive; K + shift M is factorised.
    start
        (local,) vector that the Krylov space is made from.
    method
        `slepc` (Krylov-Schur) or `arpack`, which is SciPy's where SLEPc has none, on one rank.
    configurable
        Whether PETSc's options database may overrule this set-up.
    """
    require_method(method)
    given = system, known, count, shift, start, tolerance
    if _slepc_has(method):
        from solver.reference import slepc_lanczos

        found = slepc_lanczos.smallest_eigenpairs(*given, method, configurable)
    else:
        if system.comm.size > 1:
            _refuse_ranks(system.comm.size)
        from solver.reference import scipy_arpack

        found = scipy_arpack.smallest_eigenpairs(*given)
    values, vectors = _outside(system, known, *found[:2])
    return values[:count], vectors[:, :count], found[2]


def _slepc_has(method: str) -> bool:
    """Whether SLEPc is installed, and was built with a method."""
    if not extras.is_installed(SLEPC):
        return False
    from carillon.processes.slepc import SLEPc

    return method == KRYLOV_SCHUR or bool(SLEPc.Sys.hasExternalPackage(ARPACK))


@on_all_ranks()
def _refuse_ranks(ranks: int) -> None:
    search = f"a search by ARPACK on {ranks} ranks"
    extras.require(SLEPC, search, "start one process")
    raise UserError(
        f"{search} needs a SLEPc that was built with ARPACK; take --method {KRYLOV_SCHUR}, or "
        "start one process"
    )


def _outside(system: System, known: Array, values: Array, vectors: Array) -> tuple[Array, Array]:
    """The pairs that are not in the span of the known ones, made M-orthogonal to it.

    Shift-and-invert ends with a product with the inverse, which brings back a little of inaccurate
    known ones.
    """
    share = system.inner(system.times_mass(known), vectors)
    outside = np.einsum("ij,ij->j", share, share) < 0.5
    if not outside.all():
        values, vectors, share = values[outside], vectors[:, outside], share[:, outside]
    vectors -= known @ share
    return values, vectors
