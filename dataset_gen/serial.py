"""BLAS on one thread: a sum shared among threads rounds differently, and a dataset must not."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, wraps
from typing import ParamSpec, TypeVar

import scipy.linalg  # noqa: F401  its BLAS must be loaded before the controller looks for it
from threadpoolctl import ThreadpoolController

P = ParamSpec("P")
R = TypeVar("R")


@cache
def _controller() -> ThreadpoolController:
    return ThreadpoolController()


def serial_blas(function: Callable[P, R]) -> Callable[P, R]:
    """Run `function` with one BLAS thread, so that its result is the same bits on any machine load.

    Parallelism belongs to the level above, where blocks are shared among processes.
    """

    @wraps(function)
    def serial(*args: P.args, **kwargs: P.kwargs) -> R:
        with _controller().limit(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return serial
