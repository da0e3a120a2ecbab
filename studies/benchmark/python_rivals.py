"""Rivals from Python packages: ARPACK with SuperLU or PARDISO, LOBPCG with PyAMG, and PRIMME.

PRIMME's block Davidson method is that of Stathopoulos & McCombs 2010.
"""

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as sla

from carillon.errors import ConvergenceError
from carillon.fem.model import RIGID_MODES
from carillon.processes.threads import allowed_threads
from studies.benchmark.pardiso import Pardiso
from studies.benchmark.search import Array, Pairs, RivalSearch, ascending

LANCZOS_VECTORS = 1.5
"""Lanczos vectors for each mode wanted."""
FEWEST_MORE = 24
"""Lanczos vectors beyond the modes wanted, however few these are."""
COARSEST = 300
"""Unknowns of multigrid's coarsest level, which is solved directly."""
LOBPCG_STEPS = 1000
"""Iterations that LOBPCG may make; each applies the preconditioner to all vectors left."""
MISSED = 10.0
"""Times its tolerance that LOBPCG's last Rayleigh-Ritz step may leave a residual."""
DAVIDSON = "PRIMME_GD_plusK"
"""Generalised Davidson; JDQMR, made for poor preconditioners, takes several times as long."""
BLOCK = 32
"""Vectors that Davidson adds together, for the sake of solutions and products with blocks."""
BASIS = 1.25
"""Davidson's basis vectors for each mode wanted, beside two blocks; restarts of fewer lose much."""


def arpack_superlu(search: RivalSearch) -> Pairs:
    """`eigsh` in shift-and-invert mode, with SuperLU told that the matrix is symmetric."""
    return _arpack(search, symmetric_superlu(search.shifted.tocsc()).solve)


def arpack_pardiso(search: RivalSearch) -> Pairs:
    """The same with PARDISO, which factorises K + sigma M as a definite matrix."""
    factor = Pardiso(search.shifted, definite=True, threads=allowed_threads())
    try:
        factor.analyse()
        factor.factorise()
        return _arpack(search, factor.solve)
    finally:
        factor.destroy()


def _arpack(search: RivalSearch, solve: Callable[[Array], Array]) -> Pairs:
    count = search.count + RIGID_MODES
    vectors = max(round(LANCZOS_VECTORS * count), count + FEWEST_MORE)
    values, modes = sla.eigsh(
        search.K,
        count,
        search.M,
        sigma=-search.shift,
        OPinv=search.operator(solve),
        v0=search.start(1)[:, 0],
        ncv=min(vectors, len(search.scale)),
        tol=search.tolerance,
    )
    values, modes = ascending(values, modes)
    return values[RIGID_MODES:], modes[:, RIGID_MODES:]


def symmetric_superlu(matrix: sp.csc_matrix) -> sla.SuperLU:
    """LU of a symmetric matrix by SuperLU: minimum degree, and pivots on the diagonal."""
    return sla.splu(
        matrix,
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )


def lobpcg_multigrid(search: RivalSearch) -> Pairs:
    """`lobpcg` with smoothed aggregation that knows the rigid motions, which are constraints.

    Its tolerance is one residual for all pairs, that of the highest.
    """
    largest = search.tolerance * search.interval[1]
    with warnings.catch_warnings():
        # It warns of what is an error here.
        warnings.simplefilter("ignore", UserWarning)
        values, modes, history = sla.lobpcg(
            search.stiffness,
            search.start(search.count),
            B=search.M,
            M=multigrid(search),
            Y=search.rigid,
            tol=largest,
            maxiter=LOBPCG_STEPS,
            largest=False,
            retResidualNormsHistory=True,
        )
    residual = np.linalg.norm(search.K @ modes - (search.M @ modes) * values, axis=0)
    unconverged = int(np.sum(residual > MISSED * largest))
    if unconverged:
        raise ConvergenceError(
            f"LOBPCG converged {len(values) - unconverged} of {len(values)} modes in "
            f"{len(history)} iterations"
        )
    return ascending(values, modes)


def multigrid(search: RivalSearch) -> Any:
    """Smoothed aggregation of K + sigma M, as an operator that is one V-cycle."""
    import pyamg

    hierarchy = pyamg.smoothed_aggregation_solver(
        search.shifted.tobsr((3, 3)), B=search.rigid, max_coarse=COARSEST
    )
    return hierarchy.aspreconditioner()


def davidson_direct(search: RivalSearch) -> Pairs:
    """PRIMME with (K + sigma M)^-1 by this project's own factorisation, block by block."""
    inverse = search.linear.inverse(search.system, -search.shift)
    scale = search.scale[:, None]

    def solve(block: Array) -> Array:
        rhs = np.ascontiguousarray(block.reshape(len(scale), -1) / scale)
        return np.asarray(inverse.solve(rhs) / scale)

    try:
        return _davidson(search, solve)
    finally:
        inverse.destroy()


def davidson_multigrid(search: RivalSearch) -> Pairs:
    """PRIMME with a V-cycle of PyAMG's smoothed aggregation."""
    return _davidson(search, multigrid(search).matmat)


def _davidson(search: RivalSearch, precondition: Callable[[Array], Array]) -> Pairs:
    import primme

    def converged(value: float, _: Array, residual: float) -> bool:
        return residual <= search.tolerance * abs(value)

    block = min(BLOCK, search.count)
    try:
        values, modes = primme.eigsh(
            search.stiffness,
            search.count,
            search.M,
            which="SA",
            OPinv=search.operator(precondition),
            lock=search.rigid,
            v0=search.start(block),
            ncv=min(round(BASIS * search.count) + 2 * block, len(search.scale) - RIGID_MODES),
            maxBlockSize=block,
            method=DAVIDSON,
            convtest=converged,
        )
    except primme.PrimmeError as error:
        # What a callback raises comes as its cause.
        if isinstance(error.__cause__, ConvergenceError):
            raise error.__cause__ from None
        raise ConvergenceError(f"PRIMME: {error}") from None
    return ascending(values, modes)
