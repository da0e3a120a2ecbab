"""Memory of the machine, and what a process may do to it."""

import ctypes
import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

from carillon.files.system import optional
from carillon.processes import windows_memory

FIRST_TO_GO = 500
"""Kernel score of the process, at most 1000: the highest is ended first without memory."""
LEAST_ROOM = 8 << 30
"""Least limit of a process's data in bytes: threads of large machines reserve some each."""
GROUP_LIMIT = Path("/sys/fs/cgroup/memory.max")
"""File with the most memory that the control group of this process may use."""
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3
_LARGEST_KEPT = 1 << 28
_NEVER = (1 << 31) - 1
_resource = optional("resource")


def memory_bytes(group_limit: Path = GROUP_LIMIT) -> int:
    """Memory of the machine, or what the control group of this process allows if that is less."""
    if os.name == "nt":
        return windows_memory.machine()[0]
    machine = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    try:
        return min(machine, int(group_limit.read_text()))
    except (OSError, ValueError):
        return machine


def peak_memory(children: bool = False) -> int:
    """Largest resident memory [bytes] so far of this process.

    Of the largest of its `children` that have ended, if they are asked for; Windows does not tell
    that, so that it is 0.
    """
    if os.name == "nt":
        return 0 if children else windows_memory.peak()
    who = _resource.RUSAGE_CHILDREN if children else _resource.RUSAGE_SELF
    largest: int = _resource.getrusage(who).ru_maxrss
    return largest if sys.platform == "darwin" else 1024 * largest


def available_memory() -> int | None:
    """Bytes that this process may still use: of the machine, and of its control group if limited.

    None where the system does not tell.
    """
    if os.name == "nt":
        return windows_memory.machine()[1]
    known = []
    with suppress(OSError, ValueError):
        known.append(_field("/proc/meminfo", "MemAvailable:"))
    with suppress(OSError, ValueError, StopIteration):
        known.append(_memory_of_group())
    return min(known, default=None)


def _memory_of_group() -> int:
    """What a limit of version 2 leaves; cached files make room when memory is asked for."""
    group = Path("/sys/fs/cgroup")
    limit = int((group / "memory.max").read_text())
    used = int((group / "memory.current").read_text())
    lines = (group / "memory.stat").read_text().splitlines()
    cached = next(int(line.split()[1]) for line in lines if line.startswith("file "))
    return max(0, limit - used + cached)


def reuse_freed_memory() -> None:
    """Keep freed memory in the process instead of giving it back to the system after every use.

    Blocks of vectors are made and freed many times a second; mapping their pages anew takes as long
    as a sparse product.  Those beyond 256 MB live longer, and are given back: what is kept of them
    others do not fit into.  Only the GNU C library is told; elsewhere nothing happens.
    """
    mallopt = _of_c_library("mallopt")
    if mallopt is not None:
        mallopt(_M_MMAP_THRESHOLD, _LARGEST_KEPT)
        mallopt(_M_TRIM_THRESHOLD, _NEVER)


def give_back_freed_memory() -> None:
    """Give memory that was freed, and kept for reuse, back to the system.

    For the end of a phase whose blocks the next one has no use for, and before something asks how
    much is free. Only the GNU C library is told.
    """
    trim = _of_c_library("malloc_trim")
    if trim is not None:
        trim(0)


def _of_c_library(name: str) -> Any:
    """A function of the C library that this process has; None if it has no such function."""
    return None if os.name == "nt" else getattr(ctypes.CDLL(None), name, None)


def spare_the_machine() -> None:
    """Let this process, rather than others, feel that memory runs out.

    What asks for more than twice what there is gets a MemoryError at once, which is a sentence to
    the person; else the kernel, once nothing is left, ends this process before the person's others.
    So much is asked for by no work that could be done, also where memory is reserved and not used.
    Windows has no such limits.
    """
    if os.name == "nt":
        return
    with suppress(OSError, ValueError):
        score = Path("/proc/self/oom_score_adj")
        score.write_text(str(max(FIRST_TO_GO, int(score.read_text()))))
    require_less_than(max(2 * (memory_bytes() + _swap()), LEAST_ROOM))


def require_less_than(room: int) -> None:
    """Limit what this process, and each that it starts, may ask for beyond what it has [bytes].

    Unlike a limit of addresses (RLIMIT_AS) this leaves out files, libraries and what is shared.
    """
    with suppress(OSError, ValueError):  # a limit that is lower already
        least, most = _resource.getrlimit(_resource.RLIMIT_DATA)
        limit = _field("/proc/self/status", "VmData:") + room
        if least == _resource.RLIM_INFINITY or limit < least:
            _resource.setrlimit(_resource.RLIMIT_DATA, (limit, most))


def _swap() -> int:
    with suppress(OSError, ValueError):
        return _field("/proc/meminfo", "SwapTotal:")
    return 0


def _field(file: str, name: str) -> int:
    """Bytes that a file of the kernel tells; ValueError if it does not."""
    for line in Path(file).read_text().splitlines():
        if line.startswith(name):
            return 1024 * int(line.split()[1])
    raise ValueError(f"{file} does not tell {name}")
