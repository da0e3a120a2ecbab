"""Interrupts of a search: the first Ctrl-C or SIGTERM ends the search, the second the program."""

import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from types import FrameType
from typing import Any

STOPPING = "asked to stop: the best so far is written now; ask again to end without it\n"
_interrupted: ContextVar[Callable[[], bool] | None] = ContextVar("interrupted", default=None)


@contextmanager
def ended_by_interrupts() -> Iterator[None]:
    """Let Ctrl-C end the process at once, while there is nothing to lose.

    Python would raise an exception, which some libraries swallow while they are imported.
    """
    former = _handled((signal.SIGINT,), signal.SIG_DFL)
    try:
        yield
    finally:
        _restore(former)


@contextmanager
def interruptible() -> Iterator[Callable[[], bool]]:
    """Yields a function that says whether Ctrl-C or SIGTERM came; the second one acts as before.

    Nested contexts share the outermost one's function.  Signals reach the main thread only, so in
    another thread the function is always false.
    """
    outer = _interrupted.get()
    if outer is not None:
        yield outer
        return
    asked = False

    def ask(number: int, frame: FrameType | None) -> None:
        nonlocal asked
        asked = True
        _restore(former)
        os.write(2, STOPPING.encode())

    former = _handled((signal.SIGINT, signal.SIGTERM), ask)
    token = _interrupted.set(lambda: asked)
    try:
        yield lambda: asked
    finally:
        _interrupted.reset(token)
        _restore(former)


def _handled(numbers: tuple[signal.Signals, ...], handler: Any) -> dict[signal.Signals, Any]:
    """Set the handler of signals, and return the former ones; none outside of the main thread."""
    try:
        return {number: signal.signal(number, handler) for number in numbers}
    except ValueError:
        return {}


def _restore(handlers: dict[signal.Signals, Any]) -> None:
    for number, handler in handlers.items():
        signal.signal(number, handler)
