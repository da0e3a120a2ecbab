"""What the numerical environment consists of, and whether it is slow."""

import argparse
import json
import os
import sys
from typing import Any

from carillon.errors import UserError
from carillon.processes import blas
from carillon.records import provenance


def describe() -> dict[str, Any]:
    """Versions, MPI, PETSc and SLEPc with their solvers, BLAS and cores of this environment.

    Raises UserError if PETSc, SLEPc or MPI cannot be imported.
    """
    try:
        from mpi4py import MPI

        from carillon.processes.petsc import PETSc
        from carillon.processes.slepc import SLEPc
    except ImportError as error:
        raise UserError(
            f"{error}; expected MPI, PETSc and SLEPc in the environment of {sys.executable}, "
            "run `make env`"
        ) from None
    return {
        "versions": provenance.versions(),
        "mpi": MPI.Get_library_version().split(",")[0].strip("\0 \n"),
        "petsc": _dotted(PETSc.Sys.getVersion()),
        "slepc": _dotted(SLEPc.Sys.getVersion()),
        "mumps": bool(PETSc.Sys.hasExternalPackage("mumps")),
        "cholmod": bool(PETSc.Sys.hasExternalPackage("suitesparse")),
        "arpack": bool(SLEPc.Sys.hasExternalPackage("arpack")),
        "blas": blas.blas_name(),
        "blas_by_user": blas.blas_by_user(),
        "reference_blas": blas.is_reference_blas(),
        "processor": provenance.processor(),
        "cores": len(os.sched_getaffinity(0)),
    }


def _dotted(version: tuple[int, ...]) -> str:
    return ".".join(str(part) for part in version)


def _print_table(description: dict[str, Any]) -> None:
    versions = dict(description["versions"])
    rows = {
        "Carillon": f"{versions.pop('carillon')} on Python {versions.pop('python')}",
        "packages": ", ".join(f"{name} {version}" for name, version in versions.items()),
        "MPI": description["mpi"],
        "PETSc": description["petsc"],
        "SLEPc": description["slepc"],
        "solvers": ", ".join(
            f"{label} {'yes' if description[key] else 'no'}"
            for key, label in (("mumps", "MUMPS"), ("cholmod", "CHOLMOD"), ("arpack", "ARPACK"))
        ),
        "BLAS": ", ".join(f"{user} {name}" for user, name in description["blas_by_user"].items()),
        "processor": f"{description['processor']}, {description['cores']} cores usable",
    }
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
