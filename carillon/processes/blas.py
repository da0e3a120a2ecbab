"""Which BLAS numpy, scipy and PETSc have loaded in this process."""

import ctypes
import os
import sys

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
_MAKERS_SYMBOLS = (
    "openblas_get_config",
    "MKL_Get_Version",
    "bli_info_get_version_str",
    "flexiblas_current_backend",
    "ATL_buildinfo",
)


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

    names: dict[str, str] = {}
    for info in loaded_blas():
        folder = os.path.basename(os.path.dirname(info["filepath"]))
        user = folder.removesuffix(".libs") if folder.endswith(".libs") else "PETSc"
        names.setdefault(user, f"{info['internal_api']} {info.get('version') or ''}".strip())
    if system_blas_path() is not None:
        names["PETSc"] = blas_name()
        # Without copies of their own they use that of the system.
        return {user: names.get(user, names["PETSc"]) for user in ("PETSc", "numpy", "scipy")}
    return {user: names[user] for user in ("numpy", "scipy") if user in names}


def warn_about_reference_blas() -> None:
    """Print a warning when PETSc, already imported, runs on the slow reference BLAS."""
    if is_reference_blas():
        print(
            f"warning: PETSc uses the reference BLAS ({system_blas_path()}), several times slower "
            "than OpenBLAS; install libopenblas0-pthread (Debian/Ubuntu) or select another BLAS",
            file=sys.stderr,
        )
