"""Count of the eigenvalues below a value by a factorisation in single precision, if that proves it.

It takes half the time of one in double precision, and counts the eigenvalues of a matrix F that
differs from A = K - value M by rounding.
"""

import numpy as np

from solver.assembly.system import System
from solver.linear import Inverse, LinearSolver
from solver.linear.rank_tree import RankTree
from solver.subspace.start import start_block

WORTHWHILE = 1e11
"""Least number of operations of a factorisation at which the proof takes less time than it
saves."""
MEMORY_SHARE = 0.8
"""Share of the free memory that the factorisation may take."""
LARGEST_DEVIATION = 0.25
"""Largest spectral radius of I - F^-1 A, as estimated, with which the count stands."""
PROBES, ROUNDS = 4, 5
"""Number of random vectors, and of steps of the power iteration that estimates it."""


def count_below(linear: LinearSolver, system: System, value: float) -> int:
    """Eigenvalues of K - value M below zero, by inertia, as fast as that can be proved; collective.

    Raises ConvergenceError on every rank if the factorisation fails.
    """
    count = count_in_single(linear.tree, system, value)
    return linear.count_below(system, value) if count is None else count


def count_in_single(tree: RankTree, system: System, value: float) -> int | None:
    """Eigenvalues of K - value M below zero; collective.

    None where it is not worthwhile, takes too much memory, or proves nothing.

    Notes
    -----
    F + t (A - F) is singular for a t only if -1/t is an eigenvalue of F^-1 (A - F).  If all of
    those are below one in magnitude, no eigenvalue passes zero on the way from F to A, which have
    as many negative ones then.
    """
    operations = system.comm.allreduce(tree.plan.operations)
    if operations < WORTHWHILE or not tree.fits(MEMORY_SHARE, np.float32):
        return None
    inverse = tree.inverse(system, value, np.float32)
    if deviation(system, inverse, value) > LARGEST_DEVIATION:
        return None
    return inverse.negative


def deviation(system: System, inverse: Inverse, value: float) -> float:
    """Estimate of the spectral radius of I - F^-1 (K - value M), where F^-1 is `inverse`."""
    block = start_block(system, PROBES, seed=0)
    growth = np.zeros(PROBES)
    size = np.sqrt(system.column_products(block, block))
    for _ in range(ROUNDS):
        block /= size
        image = system.times_stiffness(block) - value * system.times_mass(block)
        block -= inverse.solve(image)
        growth = size = np.sqrt(system.column_products(block, block))
    return float(growth.max())
