"""Threads of this process: how many it may use, those of BLAS, and work shared among them.

Work is shared at the highest level only: where threads share it, BLAS has one thread in each. What
must be the same bits on any machine runs with one thread of BLAS, too (`@blas_threads(1)`), since a
sum that threads share rounds differently.
"""

import importlib
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from typing import Any, TypeVar

from threadpoolctl import ThreadpoolController

Result = TypeVar("Result")


def core_numbers() -> set[int]:
    """Numbers of the cores that this process may use: all where the system does not tell."""
    if hasattr(os, "sched_getaffinity"):  # Linux
        return os.sched_getaffinity(0)
    return set(range(os.cpu_count() or 1))


def allowed_cores() -> int:
    """Cores that this process may use."""
    return len(core_numbers())


def allowed_threads() -> int:
    """Threads that this process may use: its cores, or fewer if `OMP_NUM_THREADS` says so."""
    cores = allowed_cores()
    requested = os.environ.get("OMP_NUM_THREADS", "")
    return min(cores, int(requested)) if requested.isdigit() and int(requested) > 0 else cores


def limit_threads(ranks: int, cores: int | None = None) -> int:
    """Give this rank its share of the cores, so that ranks x threads never exceed the cores.

    `cores` are those that all of the machine's `ranks` may use together; those of this process
    unless given. Returns the number of BLAS threads now allowed in this process.
    """
    share = (allowed_cores() if cores is None else cores) // max(1, ranks)
    threads = min(max(1, share), allowed_threads())
    ThreadpoolController().limit(limits=threads)
    os.environ["OMP_NUM_THREADS"] = str(threads)
    return threads


def split(count: int, threads: int, largest: int) -> list[tuple[int, int]]:
    """Half-open ranges that cut `count` items evenly: a multiple of `threads`, none over `largest`.

    Examples
    --------
    >>> split(10, 2, 3)
    [(0, 3), (3, 5), (5, 8), (8, 10)]
    """
    rounds = max(1, -(-count // (threads * largest)))
    pieces = min(count, threads * rounds)
    bounds = [-(-count * piece // pieces) for piece in range(pieces + 1)] if pieces else []
    return list(zip(bounds[:-1], bounds[1:], strict=True))


def in_parallel(
    work: Callable[..., Result], arguments: Sequence[tuple[Any, ...]], threads: int
) -> list[Result]:
    """Call `work` with each of `arguments` on up to `threads` threads; results in their order.

    `work` must release the global interpreter lock for most of its time.  BLAS runs on one thread
    within each call.
    """
    if threads == 1 or len(arguments) == 1:
        return [work(*each) for each in arguments]
    with blas_threads(1):
        return list(_pool(threads).map(lambda each: work(*each), arguments))


@contextmanager
def blas_threads(count: int) -> Iterator[None]:
    """Every BLAS of this process on so many threads within the body, or within a function."""
    with _controller().limit(limits=count, user_api="blas"):
        yield


@contextmanager
def one_thread() -> Iterator[None]:
    """One thread for whatever is made within the body: BLAS, and solvers that ask the runtime."""
    before = os.environ.get("OMP_NUM_THREADS")
    os.environ["OMP_NUM_THREADS"] = "1"
    try:
        with _controller().limit(limits=1):
            yield
    finally:
        if before is None:
            del os.environ["OMP_NUM_THREADS"]
        else:
            os.environ["OMP_NUM_THREADS"] = before


def look_for_libraries() -> None:
    """Have the threads of a BLAS that was loaded just now be limited with those of the others."""
    _controller.cache_clear()


@cache
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads, thread_name_prefix="carillon")


@cache
def _controller() -> ThreadpoolController:
    importlib.import_module("scipy.linalg")  # whose own BLAS is only found once it is there
    return ThreadpoolController()
