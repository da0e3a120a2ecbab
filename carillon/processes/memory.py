"""What a process may do to the memory of its machine."""

from __future__ import annotations

import resource
from contextlib import suppress
from pathlib import Path

from carillon.processes.cores import memory_bytes

FIRST_TO_GO = 500
"""Kernel score of the process, at most 1000: the highest is ended first without memory."""
LEAST_ROOM = 8 << 30
"""Least limit of a process's data in bytes: threads of large machines reserve some each."""


def spare_the_machine() -> None:
    """Let this process, rather than others, feel that memory runs out.

    What asks for more than twice what there is gets a MemoryError at once, which is a sentence to
    the person; else the kernel, once nothing is left, ends this process before the person's others.
    So much is asked for by no work that could be done, also where memory is reserved and not used.
    """
    with suppress(OSError, ValueError):
        score = Path("/proc/self/oom_score_adj")
        score.write_text(str(max(FIRST_TO_GO, int(score.read_text()))))
    require_less_than(max(2 * (memory_bytes() + _swap()), LEAST_ROOM))


def require_less_than(room: int) -> None:
    """Limit what this process, and each that it starts, may ask for beyond what it has [bytes].

    Unlike a limit of addresses (RLIMIT_AS) this leaves out files, libraries and what is shared.
    """
    with suppress(OSError, ValueError):  # a limit that is lower already
        least, most = resource.getrlimit(resource.RLIMIT_DATA)
        limit = _field("/proc/self/status", "VmData:") + room
        if least == resource.RLIM_INFINITY or limit < least:
            resource.setrlimit(resource.RLIMIT_DATA, (limit, most))


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
