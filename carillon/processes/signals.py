"""Signals that wait while something must not be interrupted."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager

ENDING = (signal.SIGINT, signal.SIGTERM)
"""Signals by which people and schedulers ask a process to end."""


@contextmanager
def endings_held_back() -> Iterator[None]:
    """Signals that ask to end wait until the body has ended; where none can wait, none does."""
    mask = getattr(signal, "pthread_sigmask", None)
    if mask is None:
        yield
        return
    former = mask(signal.SIG_BLOCK, ENDING)
    try:
        yield
    finally:
        mask(signal.SIG_SETMASK, former)
