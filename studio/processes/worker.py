"""A process that computes for the studio: asked by name, it answers in order, and may be ended."""

import asyncio
import os
import sys
import traceback
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from itertools import count
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from pathlib import Path
from threading import Thread
from typing import Any

from carillon.command_line.exit_status import meaning
from carillon.errors import UserError, one_line
from carillon.processes.children import end_process, start_process
from carillon.processes.memory import spare_the_machine

# Processes are ended at once, whatever they hold. That this is then cleaned up need not be
# told.
os.environ.setdefault("PYTHONWARNINGS", "ignore::UserWarning:multiprocessing.resource_tracker")

NICER = 5
"""Added to the niceness of these processes: the page's sound comes first."""
LOOK_SECONDS = 0.2
"""Time between two looks at how long a process has worked."""
GONE = (
    "the process that worked on this has ended, perhaps for lack of memory; try again, with a "
    "lower resolution or fewer modes"
)

Tell = Callable[[Any], None]


class Worker:
    """A process that does one thing after another, started when there is something to do.

    Parameters
    ----------
    work
        Module and class, such as `studio.processes.clips:ClipsBench`, whose methods are called in
        the process, on one object as long as the process lives.  A method that has news takes
        `tell` as its first argument, a function of one value.
    """

    def __init__(self, work: str) -> None:
        self._work = work
        self._numbers = count()
        self._process: SpawnProcess | None = None
        self._pipe: Connection | None = None
        self._waiting: dict[int, tuple[asyncio.Future[Any], Tell | None]] = {}

    @property
    def pid(self) -> int | None:
        """Number of the process, if there is one."""
        return None if self._process is None else self._process.pid

    async def call(
        self, name: str, *arguments: Any, seconds: float | None = None, tell: Tell | None = None
    ) -> Any:
        """What a method returns; `tell` is called with news of one that has some.

        Raises UserError with what the method raises, in one sentence, or if the process ended, or
        took more than so many seconds of processor time and was ended: on a busy machine, where it
        hardly gets any, it is waited for longer.
        """
        self.start()
        assert self._pipe is not None
        number = next(self._numbers)
        future: asyncio.Future[Any] = asyncio.get_running_loop().create_future()
        try:
            self._pipe.send((number, name, arguments, tell is not None))
        except OSError:  # it has just ended
            self.end()
            raise UserError(GONE) from None
        self._waiting[number] = (future, tell)
        try:
            return await self._answer(future, seconds)
        except TimeoutError:
            self.end()
            raise UserError(
                f"this took more than {seconds:g} s of processor time and was ended; expected "
                "something smaller or simpler"
            ) from None

    async def _answer(self, future: asyncio.Future[Any], seconds: float | None) -> Any:
        """Wait for an answer; TimeoutError once the process has worked that long."""
        if seconds is None:
            return await future
        until = self._worked() + seconds
        try:
            while not (await asyncio.wait([future], timeout=LOOK_SECONDS))[0]:
                if self._worked() > until:
                    raise TimeoutError
            return future.result()
        finally:
            future.cancel()

    def _worked(self) -> float:
        """Processor time [s] of the process, and of what it has started and waited for."""
        with suppress(OSError):
            fields = Path("/proc", str(self.pid), "stat").read_text().rpartition(") ")[2].split()
            return sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")
        return 0.0  # it has just ended, which is told otherwise

    def end(self) -> None:
        """End the process at once; what waits for it gets an error, and the next call another one.

        Its own children end with it.
        """
        process, pipe = self._process, self._pipe
        self._process = self._pipe = None
        if process is not None and pipe is not None:
            end_process(process)
        self._give_up()

    def start(self) -> None:
        """Start the process, if there is none."""
        if self._process is not None:
            return
        loop = asyncio.get_running_loop()
        self._pipe, other = Pipe()
        process = start_process(_serve, other, self._work)
        other.close()
        self._process = process
        Thread(target=self._listen, args=(loop, self._pipe, process), daemon=True).start()

    def _listen(
        self, loop: asyncio.AbstractEventLoop, pipe: Connection, process: SpawnProcess
    ) -> None:
        try:
            while True:
                loop.call_soon_threadsafe(self._take, pipe.recv())
        except (EOFError, OSError):
            pass
        except RuntimeError:  # the loop is closed
            return
        pipe.close()
        try:
            loop.call_soon_threadsafe(self._ended, process)
        except RuntimeError:
            return

    def _take(self, message: tuple[int, str, Any]) -> None:
        number, kind, value = message
        if number not in self._waiting:
            return
        future, tell = self._waiting[number]
        if kind == "news":
            if tell is not None:
                tell(value)
            return
        del self._waiting[number]
        if future.done():
            return
        if kind == "done":
            future.set_result(value)
        else:
            future.set_exception(UserError(*value))

    def _ended(self, process: SpawnProcess) -> None:
        if self._process is process:
            self._process = self._pipe = None
            self._give_up()

    def _give_up(self) -> None:
        waiting, self._waiting = self._waiting, {}
        for future, _ in waiting.values():
            if not future.done():
                future.set_exception(UserError(GONE))


def _serve(pipe: Connection, work: str) -> None:
    if hasattr(os, "nice"):
        os.nice(NICER)
    os.environ["OMP_NUM_THREADS"] = "1"
    module, name = work.split(":")
    done = getattr(import_module(module), name)()
    spare_the_machine()
    while True:
        try:
            number, method, arguments, has_news = pipe.recv()
        except EOFError:
            return
        tell = [_teller(pipe, number)] if has_news else []
        try:
            pipe.send((number, "done", getattr(done, method)(*tell, *arguments)))
        except Exception as error:
            pipe.send((number, "failed", _sentences(error)))


def _teller(pipe: Connection, number: int) -> Tell:
    return lambda value: pipe.send((number, "news", value))


def _sentences(error: Exception) -> tuple[str, ...]:
    if isinstance(error, UserError):
        return tuple(str(each) for each in error.args)
    sentence = meaning(error)[1]
    if sentence is not None:
        return (sentence,)
    traceback.print_exc()
    sys.stderr.flush()
    return (
        one_line(f"this failed for a fault of the program ({type(error).__name__}: {error})")
        + "; the terminal where the studio was started tells more",
    )
