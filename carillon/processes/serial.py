"""BLAS on one thread: a sum shared among threads rounds differently, and a dataset must not.

The compiled fits call no BLAS; the tables of their void patterns are made with it.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from functools import cache, wraps
from typing import ParamSpec, TypeVar

from threadpoolctl import ThreadpoolController

P = ParamSpec("P")
R = TypeVar("R")


@cache
def _controller() -> ThreadpoolController:
    importlib.import_module("scipy.linalg")  # whose own BLAS is only found once it is there
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
