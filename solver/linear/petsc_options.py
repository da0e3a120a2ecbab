"""Options that people hand to PETSc and SLEPc, and what those say to them."""

from __future__ import annotations

import ctypes
import sys
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from carillon.errors import UserError, on_all_ranks
from carillon.processes import extras

if TYPE_CHECKING:
    from carillon.processes.petsc import PETSc

OPTIONS_PREFIX = "carillon_"
"""Prefix of PETSc's options for this program."""
INNER_PREFIX, MULTIGRID_PREFIX = f"{OPTIONS_PREFIX}inner_", f"{OPTIONS_PREFIX}amg_"
"""Prefixes of PETSc's options for linear solvers of the correction."""
OUT_OF_MEMORY, OTHER_LIBRARY = 55, 76
"""PETSc's codes of errors that one rank may have alone; all ranks dislike options together."""
_ASKED_LATE = ("view", "monitor", "reason")
"""Parts of names that PETSc asks for when it has solved."""
GENERAL = ("slepc", "arpack")
"""Methods that are SLEPc's, which have an eigensolver to be configured."""

_inserted: list[str] = []


@on_all_ranks()
def insert_options(text: str | None, method: str = "slepc") -> None:
    """Put options like `-carillon_eps_ncv 400` into PETSc's database; earlier ones leave it.

    Raises UserError if an option lacks the prefix, and would be ignored by the method or mean
    something for the whole program.
    """
    if text is None and not _inserted:
        return
    extras.require(extras.PETSC, "--petsc", "leave it out")
    from carillon.processes.petsc import PETSc

    for name in _inserted:
        PETSc.Options().delValue(name)
    _inserted.clear()
    if text is None:
        return
    own = method not in GENERAL
    prefixes = (INNER_PREFIX, MULTIGRID_PREFIX) if own else (OPTIONS_PREFIX,)
    strangers = [name for name in _names(text) if not name.startswith(prefixes)]
    if strangers or not text.strip().startswith(f"-{OPTIONS_PREFIX}"):
        option = f"-{strangers[0]}" if strangers else text
        example = f"{INNER_PREFIX}mat_mumps_icntl_14" if own else f"{OPTIONS_PREFIX}eps_ncv"
        raise UserError(
            f"PETSc option {option!r}: expected names with the prefix -{prefixes[0]}, like "
            f"-{example}, for --method {method}"
        )
    PETSc.Options().insertString(text)
    _inserted[:] = _names(text)


@on_all_ranks()
def require_known_options() -> None:
    """Check, once an eigensolver is set up and before it solves, that it knows all options.

    Raises UserError if it did not ask for one of those inserted, which is then misspelt.
    """
    strange = [name for name in unused_options() if not any(part in name for part in _ASKED_LATE)]
    if strange:
        raise UserError(f"PETSc knows no option {', '.join(strange)} here; see how it is spelt")


def _names(text: str) -> list[str]:
    """Names in a text of options, without their dashes; numbers may begin with a dash, too."""
    words = [word for word in text.split() if word.startswith("-")]
    names = [word.removeprefix("-").removeprefix("-") for word in words]
    return [name for name in names if name[:1].isalpha()]


def unused_options() -> list[str]:
    """Those of the options inserted that PETSc has not asked for so far.

    None are found where PETSc's library is not, which alone can tell.
    """
    library = _library() if _inserted else None
    if library is None:
        return []
    unused = []
    for name in _inserted:
        used = ctypes.c_int(1)
        library.PetscOptionsUsed(None, name.encode(), ctypes.byref(used))
        if not used.value:
            unused.append(f"-{name}")
    return unused


def _library() -> ctypes.CDLL | None:
    with suppress(OSError):
        for line in Path("/proc/self/maps").read_text().splitlines():
            path = line.split(maxsplit=5)[-1]
            if Path(path).name.startswith("libpetsc"):
                return ctypes.CDLL(path)
    return None


def errors() -> tuple[type[Exception], ...]:
    """Exceptions of PETSc's, for `except`: none where it was not loaded, and cannot raise any."""
    if "petsc4py.PETSc" not in sys.modules:
        return ()
    from carillon.processes.petsc import PETSc

    return (PETSc.Error,)


def meaning(error: PETSc.Error, text: str | None) -> Exception:
    """What to raise for an error of PETSc's: it lacks memory, or dislikes options in `text`.

    Anything else is a fault of this program's and stays as it is.
    """
    said = str(error).strip().splitlines()[-1].split("] ", 1)[-1]
    if error.ierr == OUT_OF_MEMORY:
        return MemoryError(said)
    if text is None:
        return error
    refusal = UserError(f"PETSc refuses --petsc {text!r}: {said}")
    refusal.collective = error.ierr != OTHER_LIBRARY
    return refusal
