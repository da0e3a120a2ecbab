"""Where a number comes from: commit, versions, machine, command line, configuration."""

import hashlib
import json
import os
import platform
import shlex
import subprocess
import sys
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

import h5py
from llvmlite import binding

from carillon import ROOMS, __version__
from carillon.errors import as_text
from carillon.processes.blas import blas_name
from carillon.processes.threads import allowed_cores

_PACKAGES = (
    "numpy",
    "scipy",
    "scikit-learn",
    "numba",
    "h5py",
    "trimesh",
    "mpi4py",
    "petsc4py",
    "slepc4py",
)


@cache
def commit() -> str:
    """Commit of the checkout the packages run from; 'unknown' without one.

    It ends in `-dirty` if files differ from it, or if rooms hold files that git does not track.
    """
    described = _git("describe", "--always", "--dirty", "--abbrev=12", "--exclude=*")
    if described is None:
        return "unknown"
    added = _git("ls-files", "--others", "--exclude-standard", "--", *ROOMS)
    return f"{described}-dirty" if added and not described.endswith("-dirty") else described


def _git(*words: str) -> str | None:
    """What git prints of the checkout, None if it fails."""
    root = Path(__file__).resolve().parents[2]
    try:
        done = subprocess.run(["git", *words], cwd=root, capture_output=True, text=True, timeout=10)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.strip() if done.returncode == 0 else None


@cache
def versions() -> dict[str, str]:
    """Versions of Carillon, Python and the numerical packages in use."""
    by_package = {"carillon": __version__, "python": platform.python_version()}
    for package in _PACKAGES:
        try:
            by_package[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    return by_package


@cache
def processor() -> str:
    """Model name of the processor."""
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def compiled_for() -> str:
    """Processor that numba compiles for, as LLVM calls it: this one or that of NUMBA_CPU_NAME."""
    return os.environ.get("NUMBA_CPU_NAME") or str(binding.get_host_cpu_name())


def config_hash(parameters: dict[str, Any]) -> str:
    """Short SHA-256 of a parameter dictionary, independent of key order."""
    text = json.dumps(parameters, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def record(parameters: dict[str, Any]) -> dict[str, Any]:
    """Provenance of a result computed with `parameters`: plain values, ready for JSON or HDF5."""
    return {
        "commit": commit(),
        "config_hash": config_hash(parameters),
        "parameters": json.dumps(parameters, sort_keys=True, default=str),
        "command": _command(),
        "versions": json.dumps(versions()),
        "processor": processor(),
        "cores": allowed_cores(),
        "blas": blas_name(),
    }


def _command() -> str:
    program = Path(sys.argv[0])
    name = f"python -m {program.parent.name}" if program.name == "__main__.py" else program.name
    return as_text(shlex.join([*name.split(), *sys.argv[1:]]))


def write(file: h5py.File, parameters: dict[str, Any]) -> None:
    """Store the provenance as attributes of the group `provenance`."""
    group = file.create_group("provenance")
    for key, value in record(parameters).items():
        group.attrs[key] = value


def read(file: h5py.File) -> dict[str, Any]:
    """Provenance attributes stored by `write`."""
    if "provenance" not in file:
        return {}
    return {key: _plain(value) for key, value in file["provenance"].attrs.items()}


def _plain(value: Any) -> Any:
    return value.item() if hasattr(value, "item") else value
