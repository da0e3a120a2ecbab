"""PRIMME's block Davidson method (Stathopoulos & McCombs 2010) with two preconditioners."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from carillon.errors import ConvergenceError
from carillon.fem.model import RIGID_MODES
from studies.benchmark.scipy_rivals import multigrid
from studies.benchmark.search import Array, Pairs, RivalSearch, ascending

METHOD = "PRIMME_GD_plusK"
"""Generalised Davidson; JDQMR, made for poor preconditioners, takes several times as long."""
BLOCK = 32
"""Vectors that are added together, for the sake of solutions and products with blocks."""
BASIS = 1.25
"""Basis vectors for each mode wanted, beside two blocks; with fewer every restart loses much."""


def davidson_direct(search: RivalSearch) -> Pairs:
    """With (K + sigma M)^-1 by this project's own factorisation, for blocks of right-hand sides."""
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
    """With a V-cycle of PyAMG's smoothed aggregation."""
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
            method=METHOD,
            convtest=converged,
        )
    except primme.PrimmeError as error:
        # What a callback raises comes as its cause.
        if isinstance(error.__cause__, ConvergenceError):
            raise error.__cause__ from None
        raise ConvergenceError(f"PRIMME: {error}") from None
    return ascending(values, modes)
