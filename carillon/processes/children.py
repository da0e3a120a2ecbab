"""Programs and processes that this one starts here, and that end with it, however it ends.

Ctrl-C and the signals of schedulers go to all processes of a job. Only the one that started the
others hears them: it says when they end. They own nothing, so they are killed whatever they do.
"""

import ctypes
import os
import signal
import subprocess
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context, parent_process
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from multiprocessing.resource_tracker import ensure_running
from threading import Thread
from typing import Any, TypeVar

from carillon.processes.mpi_environment import leave_nothing, no_rank
from carillon.processes.signals import endings_held_back

Result = TypeVar("Result")

PATIENCE_SECONDS = 10.0
"""Time that a program gets to end its own children, once it has been told to end."""

CONTEXT = get_context("spawn")
"""How processes are started: not forked, as MPI and threads do not survive that."""

_LOOK_SECONDS = 0.1
_SETTLED_SECONDS = 1.0
"""Time within which the system tells the exit code of a process that has just died."""
_PIPE_BYTES = 1 << 20
_PR_SET_PDEATHSIG = 1


def run_child(
    command: Sequence[str], environment: Mapping[str, str], seconds: float | None = None
) -> subprocess.CompletedProcess[str]:
    """Run a program to its end and collect what it prints.

    It is sent SIGTERM when this process dies, also by SIGKILL, or leaves by an exception: launchers
    of MPI end their ranks then.  Raises subprocess.TimeoutExpired if it takes longer than
    `seconds`; it has ended then.
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
            out, said = child.communicate(timeout=seconds)
        except BaseException:
            _end(child)
            raise
    return subprocess.CompletedProcess(child.args, child.returncode, out, said)


def _tied_to(parent: int) -> Callable[[], None] | None:
    """Preparation of a child before it becomes the program; it can neither import nor lock there.

    None on Windows, where it cannot do anything.
    """
    if os.name == "nt":
        return None
    # Only Linux has it. Elsewhere the program goes on until it is told to end.
    control = getattr(ctypes.CDLL(None, use_errno=True), "prctl", None)

    def tie() -> None:
        # Where this process does not hear the signal, the program would not either.
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, (signal.SIGTERM,))
        if control is not None:
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


def start_process(work: Callable[..., None], *arguments: Any) -> SpawnProcess:
    """Start a process that calls `work` and then ends, or at once when this one is gone."""
    process = CONTEXT.Process(target=_begin, args=(work, arguments))
    with _quietly():
        process.start()
    return process


def end_process(process: Any) -> None:
    """End a process at once, whatever it is doing."""
    process.kill()
    process.join()
    leave_nothing(os.environ, process.pid or 0)


class ProcessPool:
    """Processes that do tasks side by side.

    Parameters
    ----------
    workers
        Number of processes. They are started with the first tasks.
    prepare, arguments
        Called in each of them before its first task. The arguments have to fit into a pipe.
    """

    def __init__(
        self, workers: int, prepare: Callable[..., None] | None = None, *arguments: Any
    ) -> None:
        self._executor = ProcessPoolExecutor(workers, CONTEXT, _begin, (prepare, arguments))
        self._processes: dict[int, SpawnProcess] = {}

    def submit(self, work: Callable[..., Result], *arguments: Any) -> Future[Result]:
        """Have a task done; its future raises BrokenProcessPool once any of the processes died."""
        with _quietly():  # submitting starts the processes
            future = self._executor.submit(work, *arguments)
        executor: Any = self._executor
        self._processes |= executor._processes
        return future

    def in_order(
        self, work: Callable[..., Result], tasks: Iterable[Any], window: int
    ) -> Iterator[Result]:
        """Results of the tasks in their order; no more than `window` are begun and not yielded."""
        waiting: deque[Future[Result]] = deque()
        for task in tasks:
            waiting.append(self.submit(work, task))
            if len(waiting) == window:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()

    def failure(self) -> int | None:
        """Exit code of a process that died, -9 if it was killed; None if none did."""
        until = time.monotonic() + _SETTLED_SECONDS
        while time.monotonic() < until:
            for process in self._processes.values():
                if process.exitcode:
                    return process.exitcode
            time.sleep(_LOOK_SECONDS / 10)
        return None

    def close(self) -> None:
        """End the processes, whatever they are doing."""
        executor: Any = self._executor
        if executor._result_queue is None:  # ended before
            return
        processes = self._processes.values()
        for process in processes:
            process.kill()
        manager, tasks = executor._executor_manager_thread, executor._call_queue
        # The thread that manages them may be reading a result that one of them has half written. It
        # waits for the rest as long as anybody could write it, and this process could.
        executor._result_queue._writer.close()
        executor.shutdown(wait=False, cancel_futures=True)
        if manager is not None:
            _join(manager, tasks._reader)
        for process in processes:
            leave_nothing(os.environ, process.pid or 0)


def _join(manager: Thread, tasks: Connection) -> None:
    """Wait for the thread that manages processes which were killed.

    It waits for tasks to be written that nobody reads any more, so these are read here; Python does
    that itself from 3.12 on.
    """
    while manager.is_alive():
        try:
            if tasks.poll(_LOOK_SECONDS):
                os.read(tasks.fileno(), _PIPE_BYTES)
        except OSError:  # closed by the thread
            break
    manager.join()


@contextmanager
def _quietly() -> Iterator[None]:
    """Processes started in the body hear no signal that asks to stop, and are no MPI ranks."""
    if os.name != "nt":
        ensure_running()  # of Python's own, which lets the signals through once it is started
    with endings_held_back(), no_rank(os.environ):
        yield


def _begin(prepare: Callable[..., None] | None, arguments: tuple[Any, ...]) -> None:
    """Call what a process begins with, which a thread of it ends when its parent is gone."""
    parent = parent_process()
    if parent is not None:
        Thread(target=_end_after, args=(parent.sentinel,), daemon=True).start()
    if prepare is not None:
        prepare(*arguments)


def _end_after(sentinel: int) -> None:
    wait([sentinel])
    leave_nothing(os.environ, os.getpid())
    os._exit(1)
