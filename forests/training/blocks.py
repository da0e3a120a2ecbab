"""Work on blocks of a dataset, some of them at once, with the results in order."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

T = TypeVar("T")
U = TypeVar("U")

WINDOW = 2
"""Blocks of each thread that are ready or at work."""


def in_order(
    pool: ThreadPoolExecutor, action: Callable[[T], U], items: Iterable[T], ahead: int
) -> Iterator[U]:
    """Results of an action on all items in order, so many of them begun ahead of time.

    joblib begins new items as soon as others are done, however far behind is who takes the results;
    so it would hold a dataset in memory.
    """
    running: deque[Future[U]] = deque()
    for item in items:
        running.append(pool.submit(action, item))
        if len(running) > ahead:
            yield running.popleft().result()
    while running:
        yield running.popleft().result()
