"""What the numerical environment consists of, and whether it is slow."""

import argparse
import json
from typing import Any

from carillon.processes import blas, extras, threads
from carillon.processes.extras import MPI, PETSC, SLEPC
from carillon.records import provenance


def describe() -> dict[str, Any]:
    """Versions, MPI, PETSc and SLEPc with their solvers, BLAS and cores of this environment.

    MPI, PETSc and SLEPc are None where they are not installed, and their solvers absent then.
    """
    return {
        "versions": provenance.versions(),
        **_of_cluster(),
        "blas": blas.blas_name(),
        "blas_by_user": blas.blas_by_user(),
        "reference_blas": blas.is_reference_blas(),
        "processor": provenance.processor(),
        "cores": threads.allowed_cores(),
    }


def _of_cluster() -> dict[str, Any]:
    """Versions of MPI, PETSc and SLEPc, None of those not installed, and what these bring along."""
    found: dict[str, Any] = {"mpi": None, "petsc": None, "slepc": None}
    solvers = dict.fromkeys(("mumps", "cholmod", "arpack"), False)
    if extras.is_installed(MPI):
        from carillon.processes.mpi import MPI as mpi  # noqa: N811

        found["mpi"] = mpi.Get_library_version().split(",")[0].strip("\0 \n")
    if extras.is_installed(PETSC):
        from carillon.processes.petsc import PETSc

        found["petsc"] = _dotted(PETSc.Sys.getVersion())
        solvers["mumps"] = bool(PETSc.Sys.hasExternalPackage("mumps"))
        solvers["cholmod"] = bool(PETSc.Sys.hasExternalPackage("suitesparse"))
    if extras.is_installed(SLEPC):
        from carillon.processes.slepc import SLEPc

        found["slepc"] = _dotted(SLEPc.Sys.getVersion())
        solvers["arpack"] = bool(SLEPc.Sys.hasExternalPackage("arpack"))
    return found | solvers


def _dotted(version: tuple[int, ...]) -> str:
    return ".".join(str(part) for part in version)


def _print_table(description: dict[str, Any]) -> None:
    versions = dict(description["versions"])
    absent = f"not installed; {extras.install()}"
    rows = {
        "Carillon": f"{versions.pop('carillon')} on Python {versions.pop('python')}",
        "packages": ", ".join(f"{name} {version}" for name, version in versions.items()),
        "MPI": description["mpi"] or absent,
        "PETSc": description["petsc"] or absent,
        "SLEPc": description["slepc"] or absent,
        "solvers": ", ".join(
            f"{label} {'yes' if description[key] else 'no'}"
            for key, label in (("mumps", "MUMPS"), ("cholmod", "CHOLMOD"), ("arpack", "ARPACK"))
        ),
        "BLAS": ", ".join(f"{user} {name}" for user, name in description["blas_by_user"].items()),
        "processor": f"{description['processor']}, {description['cores']} cores usable",
    }
    if description["petsc"] is None:
        del rows["solvers"]
    for name, text in rows.items():
        print(f"{name:<10} {text}")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def run(arguments: argparse.Namespace) -> None:
    """Print the description of the environment, as a table or as JSON."""
    description = describe()
    if arguments.json:
        print(json.dumps(description, indent=2))
    else:
        _print_table(description)
    blas.warn_about_reference_blas()
