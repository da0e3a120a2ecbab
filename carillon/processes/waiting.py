"""Ranks that wait for others and leave the cores to them meanwhile.

Open MPI looks for messages without a pause.  Where there are more ranks than cores, a rank that
waits keeps a core from the one it waits for until the system takes it away: milliseconds for every
message.  To yield the core (`mpi_yield_when_idle`) helps where ranks are alone; other busy programs
get it for their whole turn.  A rank that sleeps for a moment is woken at once.
"""

import atexit
import ctypes
import os
from typing import Any

from carillon.processes.ranks import Comm
from carillon.processes.threads import core_numbers

NAP_MICROSECONDS = 20
"""Sleep between two looks for messages in microseconds; the system adds some fifty."""
_LIBRARY = "libopen-pal.so"
_ASKED = "OMPI_MCA_mpi_yield_when_idle"
_napping: list[Any] = []
"""Function that Open MPI calls while it waits; kept here so that it is not freed."""


def leave_cores(comm: Comm) -> bool:
    """Have ranks sleep between their looks for messages if they share cores; collective.

    They do if their machine has fewer cores for them, or if `OMPI_MCA_mpi_yield_when_idle=1` tells
    that other programs run besides.  Nothing happens under another MPI than
    Open MPI. Returns whether this rank does from now on.
    """
    return _share_cores(comm) and _nap_while_waiting()


def _share_cores(comm: Comm) -> bool:
    """Whether the ranks of this machine have fewer cores than they are, or said so."""
    if comm.size == 1:
        return False
    from carillon.processes.mpi import MPI

    machine = comm.Split_type(MPI.COMM_TYPE_SHARED)
    try:
        cores = set().union(*machine.allgather(core_numbers()))
        return machine.size > len(cores) or os.environ.get(_ASKED) == "1"
    finally:
        machine.Free()


def _nap_while_waiting() -> bool:
    library = _open_mpi()
    if library is None or _napping:
        return bool(_napping)
    nap = _compiled_nap()
    address = ctypes.c_void_p(nap.address)
    if library.opal_progress_register_lp(address) != 0:
        return False
    _napping.append(nap)
    library.opal_progress_set_yield_when_idle(ctypes.c_bool(False))
    # The compiled function goes with Python, and MPI ends after it.
    atexit.register(library.opal_progress_unregister, address)
    return True


def _open_mpi() -> Any | None:
    """The library that looks for messages, if it is loaded and has what is needed here."""
    try:
        with open("/proc/self/maps") as maps:
            paths = {line.split(maxsplit=5)[-1].strip() for line in maps if _LIBRARY in line}
        library = ctypes.CDLL(min(paths)) if paths else None
    except OSError:
        return None
    names = ("register_lp", "unregister", "set_yield_when_idle")
    if library is None or not all(hasattr(library, f"opal_progress_{name}") for name in names):
        return None
    return library


def _compiled_nap() -> Any:
    """A function without arguments for C, which sleeps and tells that no message has come."""
    from numba import cfunc, types

    sleep = ctypes.CDLL(None).usleep
    sleep.argtypes, sleep.restype = [ctypes.c_uint], ctypes.c_int

    @cfunc(types.intc())
    def nap():  # type: ignore[no-untyped-def]
        sleep(NAP_MICROSECONDS)
        return 0

    return nap
