"""How many modes can be asked for, and how many are kept to find them."""

from typing import cast

from carillon.errors import UserError, on_all_ranks
from carillon.fem.model import Solid
from carillon.processes.memory import available_memory
from carillon.processes.mpi import MPI
from solver.analysis.options import SolverOptions
from solver.correction.criteria import FEWEST_GUARDS, default_guard
from solver.distribution.collective import bcast_from_root, ranks_of_machine
from solver.reference.truth import SPARE_MODES

KEPT_FRACTION, TOGETHER_FRACTION = 1.6, 1.17
"""Modes kept at the root of the merge tree as a multiple of those requested: in general, and where
a block Lanczos iteration corrects them together."""
FEW_PARTS = 16
"""Largest number of subdomains for which these multiples hold. Beyond it the best ones grow about
like the cube root of the number."""
LEAST_LOCAL = 60
"""Modes that a subdomain of average size keeps at least where nothing corrects them. With fewer
beside its rigid motions, frequencies are off by tens of per cent."""
FEWEST_BLOCKS, FEWEST_SQUARES = 2, 2
"""Least number of blocks of all vectors, and of matrices of their products, that any method keeps
at a time."""


@on_all_ranks()
def check_mode_count(modes: int, n_dofs: int) -> None:
    """Raise UserError unless there are unknowns for all `modes`."""
    if modes > n_dofs:
        raise UserError(
            f"{modes:,} modes asked for, but the model has {n_dofs:,} unknowns; ask for fewer or "
            "raise the resolution"
        )


def require_memory(model: Solid | None, options: SolverOptions, comm: MPI.Comm) -> None:
    """Raise UserError if the vectors of this rank's machine alone are more than its free memory."""
    share = ranks_of_machine(comm) / comm.size

    def check() -> None:
        n_dofs = cast(Solid, model).n_dofs
        vectors = min(max(options.modes, options.retained_modes or 0), n_dofs)
        needed = 8 * vectors * (FEWEST_BLOCKS * n_dofs * share + FEWEST_SQUARES * vectors)
        free = available_memory()
        if free is not None and needed > free:
            raise UserError(
                f"{vectors:,} modes of {n_dofs:,} unknowns take {needed / 1e9:,.1f} GB at least, "
                f"{free / 1e9:,.1f} GB are free; ask for fewer modes or a lower resolution"
            )

    bcast_from_root(comm, check)


def uncorrected_keep(modes: int, parts: int) -> int:
    """Modes kept at the root where they stay as they are, see `modes_to_keep` of the groups."""
    return max(default_keep(modes, parts), int(LEAST_LOCAL * parts**0.5))


def default_keep(modes: int, parts: int, together: bool = False) -> int:
    """Modes kept at the root: those that the correction iterates, and some to choose from.

    More would be a better start, but take longer than they save where modes are corrected
    `together`.  Modes of many small subdomains need to be more to be as good.
    """
    grown = max(1.0, parts / FEW_PARTS) ** (1.0 / 3.0)
    if together:
        return max(int(TOGETHER_FRACTION * grown * modes), modes + FEWEST_GUARDS + SPARE_MODES)
    return max(int(KEPT_FRACTION * grown * modes), modes + default_guard(modes) + SPARE_MODES)
