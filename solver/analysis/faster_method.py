"""Whether many cheap steps take less time than a factorisation, reckoned before either is begun.

The constants are seconds on two cores of a processor with AVX-512, see `docs/results/measured.md`.
Only their ratios matter, which other processors and ranks change little.
"""

from math import log10

from carillon.processes import extras
from solver.analysis.options import SolverOptions
from solver.correction.criteria import EIGENVALUE_TOLERANCE, default_guard
from solver.linear.rank_tree import RankTree

FEWEST_UNKNOWNS = 100_000
"""Least number of unknowns at which conjugate gradients are considered."""
CLEARLY_LESS = 0.85
"""Share of the time of block Lanczos that they may take, since steps are not known before."""
FACTOR, SOLVE = 1.0 / 60e9, 1.0 / 45e9
"""Seconds for an operation of a factorisation, and of a solve."""
SOLVES_A_MODE, SOLVES = 2.1, 40
"""Right-hand sides of block Lanczos for each mode, and beyond that."""
SETUP, STEP = 1.4e-5, 4e-8
"""Seconds for each unknown: of the levels of multigrid, and of a right-hand side's cycle with its
products."""
WIDTH = 80
"""Number of vectors at which the products of all of them take as long as that."""
STEPS_A_DECADE, FROM_COARSE, FROM_RANDOM, FEWEST_STEPS = 1.7, -1.5, 3.0, 3.0
"""Steps for each decade of the tolerance, and beyond that from coarse modes and from random
vectors; at least so many."""


def gradients_are_faster(
    tree: RankTree, n_dofs: int, options: SolverOptions, from_coarse: bool
) -> bool:
    """Whether LOBPCG is expected to be clearly faster than block Lanczos; collective.

    It starts from random vectors, or from coarse modes. It is not without PETSc, whose multigrid it
    needs.
    """
    if n_dofs < FEWEST_UNKNOWNS or not extras.is_installed(extras.PETSC):
        return False
    factor, solve = tree.operations()
    lanczos = FACTOR * factor + SOLVE * (SOLVES_A_MODE * options.modes + SOLVES) * solve
    tolerance = EIGENVALUE_TOLERANCE if options.tolerance is None else options.tolerance
    width = options.modes + default_guard(options.modes)
    first = FROM_COARSE if from_coarse else FROM_RANDOM
    steps = max(FEWEST_STEPS, STEPS_A_DECADE * -log10(tolerance) + first)
    solves = STEP * steps * width * (1.0 + width / WIDTH)
    return n_dofs * (SETUP + solves) < CLEARLY_LESS * lanczos
