"""The numerical runtime: which BLAS is loaded, how many threads each rank may use."""

from __future__ import annotations

import ctypes
import os
import sys
from pathlib import Path

from threadpoolctl import ThreadpoolController

_BLAS_FILES = (
    "libblas.",
    "libopenblas",
    "libmkl_rt",
    "libmkl_core",
    "libblis",
    "libflexiblas",
    "libatlas",
)
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3
_LARGEST_THRESHOLD = 1 << 30
_NEVER = (1 << 31) - 1
_MAKERS_SYMBOLS = (
    "openblas_get_config",
    "MKL_Get_Version",
    "bli_info_get_version_str",
    "flexiblas_current_backend",
    "ATL_buildinfo",
)

GROUP_LIMIT = Path("/sys/fs/cgroup/memory.max")
"""File with the most memory that the control group of this process may use."""


def loaded_blas() -> list[dict[str, str]]:
    """BLAS libraries in this process that threadpoolctl knows (OpenBLAS, MKL, BLIS, FlexiBLAS).

    Ordered by path, numpy's copy before scipy's; threadpoolctl's own order changes from run to run.
    """
    libraries = [info for info in ThreadpoolController().info() if info["user_api"] == "blas"]
    return sorted(libraries, key=lambda info: str(info["filepath"]))


def system_blas_path() -> str | None:
    """File of the BLAS that PETSc and MUMPS use in this process, None if none is loaded.

    The copies of OpenBLAS that the wheels of numpy and scipy carry (folders `numpy.libs` and
    `scipy.libs`) serve only these two and do not count.
    """
    paths = [path for path in _mapped_files() if _is_system_blas(path)]
    # The interface that PETSc was linked with tells more than what it may be built upon.
    paths.sort(key=lambda path: not os.path.basename(path).startswith("libblas."))
    return paths[0] if paths else None


def is_reference_blas() -> bool:
    """True if PETSc's BLAS is the unoptimised reference implementation.

    Every optimised BLAS may stand behind the name `libblas.so.3`; it is known by the functions that
    only its maker has, which the reference implementation lacks.
    """
    path = system_blas_path()
    if path is None or not os.path.basename(path).startswith("libblas."):
        return False
    library = ctypes.CDLL(path)
    return not any(hasattr(library, symbol) for symbol in _MAKERS_SYMBOLS)


def _is_system_blas(path: str) -> bool:
    if os.path.dirname(path).endswith(".libs"):
        return False
    return os.path.basename(path).startswith(_BLAS_FILES)


def _mapped_files() -> list[str]:
    try:
        with open("/proc/self/maps") as maps:
            fields = [line.rstrip("\n").split(maxsplit=5) for line in maps]
    except OSError:
        return []
    return list(dict.fromkeys(field[5] for field in fields if len(field) == 6))


def blas_name() -> str:
    """Name and version of the BLAS that PETSc uses where it is loaded, else the one numpy uses."""
    if is_reference_blas():
        return f"reference BLAS ({system_blas_path()})"
    infos = loaded_blas()
    system = [info for info in infos if _is_system_blas(info["filepath"])]
    chosen = (system or infos)[:1]
    if not chosen:
        return system_blas_path() or "unknown"
    return f"{chosen[0]['internal_api']} {chosen[0].get('version') or ''}".strip()


def blas_by_user() -> dict[str, str]:
    """Name and version of the BLAS of numpy, of scipy, and of PETSc where it is loaded."""
    # Libraries are seen once they are loaded.
    import numpy  # noqa: F401
    import scipy.linalg  # noqa: F401

    found: dict[str, str] = {}
    for info in loaded_blas():
        folder = os.path.basename(os.path.dirname(info["filepath"]))
        user = folder.removesuffix(".libs") if folder.endswith(".libs") else "PETSc"
        found.setdefault(user, f"{info['internal_api']} {info.get('version') or ''}".strip())
    if system_blas_path() is not None:
        found["PETSc"] = blas_name()
        # Without copies of their own they use that of the system.
        return {user: found.get(user, found["PETSc"]) for user in ("PETSc", "numpy", "scipy")}
    return {user: found[user] for user in ("numpy", "scipy") if user in found}


def warn_about_reference_blas() -> None:
    """Print a warning when PETSc, already imported, runs on the slow reference BLAS."""
    if is_reference_blas():
        print(
            f"warning: PETSc uses the reference BLAS ({system_blas_path()}), several times slower "
            "than OpenBLAS; install libopenblas0-pthread (Debian/Ubuntu) or select another BLAS",
            file=sys.stderr,
        )


def reuse_freed_memory() -> None:
    """Keep freed memory in the process instead of giving it back to the system after every use.

    Blocks of vectors are made and freed many times a second; mapping their pages anew takes as long
    as a sparse product.  Only the GNU C library is told; elsewhere nothing happens.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(_M_MMAP_THRESHOLD, _LARGEST_THRESHOLD)
        mallopt(_M_TRIM_THRESHOLD, _NEVER)


def allowed_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0))


def allowed_threads() -> int:
    """Threads that this process may use: its cores, or fewer if `OMP_NUM_THREADS` says so."""
    cores = allowed_cores()
    requested = os.environ.get("OMP_NUM_THREADS", "")
    return min(cores, int(requested)) if requested.isdigit() and int(requested) > 0 else cores


def limit_threads(ranks: int) -> int:
    """Give this rank its share of the cores, so that ranks x threads never exceed the cores.

    Returns the number of BLAS threads now allowed in this process.
    """
    cores = allowed_cores()
    threads = max(1, cores // max(1, ranks))
    requested = os.environ.get("OMP_NUM_THREADS", "")
    if requested.isdigit() and int(requested) > 0:
        threads = min(threads, int(requested))
    ThreadpoolController().limit(limits=threads)
    os.environ["OMP_NUM_THREADS"] = str(threads)
    return threads


def memory_bytes(group_limit: Path = GROUP_LIMIT) -> int:
    """Memory of the machine, or what the control group of this process allows if that is less."""
    machine = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    try:
        return min(machine, int(group_limit.read_text()))
    except (OSError, ValueError):
        return machine


def available_memory() -> int | None:
    """Bytes that this process may still use: of the machine, and of its control group if limited.

    None where the system does not tell.
    """
    limits = [_memory_of_machine(), _memory_of_group()]
    known = [each for each in limits if each is not None]
    return min(known) if known else None


def _memory_of_machine() -> int | None:
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
    except OSError:
        return None
    for line in lines:
        if line.startswith("MemAvailable:"):
            return 1024 * int(line.split()[1])
    return None


def _memory_of_group() -> int | None:
    """What a limit of version 2 leaves; cached files make room when memory is asked for."""
    group = Path("/sys/fs/cgroup")
    try:
        limit = int((group / "memory.max").read_text())
        used = int((group / "memory.current").read_text())
        lines = (group / "memory.stat").read_text().splitlines()
        cached = next(int(line.split()[1]) for line in lines if line.startswith("file "))
    except (OSError, ValueError, StopIteration):
        return None
    return max(0, limit - used + cached)
