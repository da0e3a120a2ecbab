"""Packages that Carillon uses where they are installed: its extras `cluster` and `workflow`.

On one machine everything but what names them runs without MPI, PETSc and SLEPc.  These two get
their communicators from mpi4py, so that they count as installed with it alone.
"""

import os
from importlib import import_module
from importlib.util import find_spec

from carillon.errors import UserError, on_all_ranks
from carillon.processes import rooms

MPI, PETSC, SLEPC = "mpi4py", "petsc4py", "slepc4py"
NEEDED = {MPI: (MPI,), PETSC: (MPI, PETSC), SLEPC: (MPI, PETSC, SLEPC)}
"""Packages that each of the cluster's needs, itself included."""
EXTRAS = {
    "cluster": (MPI, PETSC, SLEPC),
    "workflow": ("snakemake", "jinja2", "matplotlib", "pandas"),
}


def install(extra: str = "cluster") -> str:
    """Advice to get the packages of an extra, beside an installation or in a checkout."""
    installed = os.path.isdir(rooms.INSTALLED)
    command = f"pip install 'carillon[{extra}]'" if installed else "make env"
    return f"run `{command}` (docs/howto/environment.md)"


def is_installed(package: str) -> bool:
    """Whether one of the cluster's packages can be used, which is not loaded for that.

    Examples
    --------
    >>> is_installed(PETSC) <= is_installed(MPI)
    True
    """
    return not _missing(package)


@on_all_ranks()
def require(package: str, what: str, instead: str | None = None) -> None:
    """Raise UserError unless one of the cluster's packages is installed.

    The sentence says `what` needs it, and what can be done `instead` of installing it, if anything.
    """
    missing = _missing(package)
    if missing:
        remedy = install() if instead is None else f"{instead}, or {install()}"
        raise UserError(
            f"{what} needs {' and '.join(missing)}, which {'is' if len(missing) == 1 else 'are'} "
            f"not installed; {remedy}"
        )


def lack(error: ModuleNotFoundError) -> str | None:
    """A sentence on a package of an extra that was not found; None on any other module.

    Examples
    --------
    >>> print(lack(ModuleNotFoundError("No module named 'numpy'", name="numpy")))
    None
    """
    package = (error.name or "").partition(".")[0]
    extra = next((name for name, packages in EXTRAS.items() if package in packages), None)
    return extra and f"this needs {package}, which is not installed; {install(extra)}"


def load_cluster() -> None:
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
