"""Programs that this one starts and that end with it, however it ends."""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
from collections.abc import Callable, Mapping, Sequence
from multiprocessing import parent_process
from multiprocessing.connection import wait
from threading import Thread

from carillon.processes.mpi_environment import leave_nothing

PATIENCE_SECONDS = 10.0
"""Time that a program gets to end its own children, once it has been told to end."""

_PR_SET_PDEATHSIG = 1


def run_child(
    command: Sequence[str], environment: Mapping[str, str]
) -> subprocess.CompletedProcess[str]:
    """Run a program to its end and collect what it prints.

    It is sent SIGTERM when this process dies, also by SIGKILL, or leaves by an exception: launchers
    of MPI end their ranks then.
    """
    with subprocess.Popen(
        command,
        env=dict(environment),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        errors="backslashreplace",
        preexec_fn=_tied_to(os.getpid()),
    ) as child:
        try:
            out, said = child.communicate()
        except BaseException:
            _end(child)
            raise
    return subprocess.CompletedProcess(child.args, child.returncode, out, said)


def end_with_parent() -> None:
    """Let this process, which `multiprocessing` started, end when its parent is gone, however.

    From a thread of its own, so that it ends in the midst of whatever it does.
    """
    parent = parent_process()
    if parent is not None:
        Thread(target=_end_after, args=(parent.sentinel,), daemon=True).start()


def _end_after(sentinel: int) -> None:
    wait([sentinel])
    leave_nothing(os.environ, os.getpid())
    os._exit(1)


def _tied_to(parent: int) -> Callable[[], None]:
    """What the child does before it becomes the program; it can neither import nor lock there."""
    control = ctypes.CDLL(None, use_errno=True).prctl

    def tie() -> None:
        control(_PR_SET_PDEATHSIG, signal.SIGTERM, 0, 0, 0)
        if os.getppid() != parent:  # which has died before that
            os._exit(1)

    return tie


def _end(child: subprocess.Popen[str]) -> None:
    child.terminate()
    try:
        child.communicate(timeout=PATIENCE_SECONDS)
    except subprocess.TimeoutExpired:
        child.kill()
