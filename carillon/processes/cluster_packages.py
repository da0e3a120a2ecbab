"""Packages of the extra `cluster`, which Carillon uses where they are installed: MPI, PETSc, SLEPc.

On one machine everything but what is named here runs without them.  PETSc and SLEPc get their
communicators from mpi4py, so that they count as installed with it alone.
"""

import os
from importlib import import_module
from importlib.util import find_spec

from carillon.errors import UserError, on_all_ranks
from carillon.processes import rooms

MPI, PETSC, SLEPC = "mpi4py", "petsc4py", "slepc4py"
NEEDED = {MPI: (MPI,), PETSC: (MPI, PETSC), SLEPC: (MPI, PETSC, SLEPC)}
"""Packages that each of them needs, itself included."""
_COMMAND = "pip install 'carillon[cluster]'" if os.path.isdir(rooms.INSTALLED) else "make env"
INSTALL = f"run `{_COMMAND}` (docs/howto/environment.md)"
"""How they are installed, beside an installation or in a checkout, for messages."""


def is_installed(package: str) -> bool:
    """Whether one of the packages can be used, which is not loaded for that.

    Examples
    --------
    >>> is_installed(PETSC) <= is_installed(MPI)
    True
    """
    return not _missing(package)


@on_all_ranks()
def require(package: str, what: str, instead: str) -> None:
    """Raise UserError unless one of the packages is installed.

    The sentence says `what` needs it, and what can be done `instead` of installing it.
    """
    missing = _missing(package)
    if missing:
        raise UserError(
            f"{what} needs {' and '.join(missing)}, which {'is' if len(missing) == 1 else 'are'} "
            f"not installed; {INSTALL}, or {instead}"
        )


def load() -> None:
    """Load those of PETSc and SLEPc that are installed; collective over all ranks of the job."""
    for package, module in ((PETSC, "petsc"), (SLEPC, "slepc")):
        if is_installed(package):
            import_module(f"carillon.processes.{module}")


def _missing(package: str) -> list[str]:
    return [each for each in NEEDED[package] if not _is_found(each)]


def _is_found(package: str) -> bool:
    try:
        return find_spec(package) is not None
    except (ImportError, ValueError):  # someone hides it
        return False
