"""How long tests wait: a bound against hangs, never a demand on speed (test support)."""

import subprocess
import time
from collections.abc import Callable

import psutil

HANG_SECONDS = 1800.0
"""What takes longer hangs, on however busy a machine; less than pytest itself waits."""
PATIENCE_SECONDS = 180.0
"""What a page does at once is there by then, beside ten busy processes, too."""


def wait_for(
    met: Callable[[], object], what: str, run: subprocess.Popen[str] | None = None
) -> None:
    """Wait until something is so.

    Parameters
    ----------
    met
        Whether it is so.
    what
        Is waited for.
    run
        A process without which it cannot happen.

    Raises
    ------
    AssertionError
        If the process ends before, or nothing happens at all.
    """
    until = time.monotonic() + HANG_SECONDS
    while not met():
        assert run is None or run.poll() is None or met(), f"{what}: the run has ended before"
        assert time.monotonic() < until, f"{what}: not within {HANG_SECONDS:g} s"
        time.sleep(0.05)


def words_of(process: psutil.Process) -> list[str]:
    """The command line of a process; nothing once it has ended, which it may at any moment."""
    try:
        return process.cmdline()
    except psutil.NoSuchProcess:
        return []
