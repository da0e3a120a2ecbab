"""Work that threads share by tickets: each takes the next, and waits for what earlier ones made.

Counters are entries of an int64 array of zeros.  A thread waits for earlier tickets alone, which
threads that are at work have taken: so it never waits for a thread that has not begun, and one
thread by itself does all the work.  Who does a ticket changes nothing in what comes out.
"""

import os
from pathlib import Path
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic as numba_intrinsic

from carillon.numerics.simd import compiler

intrinsic: Any = numba_intrinsic
compiled = compiler(Path(__file__))

PATIENCE = 2000
"""Looks at a counter before the core is offered to others."""

_give_way = types.ExternalFunction(
    "SwitchToThread" if os.name == "nt" else "sched_yield", types.intc()
)


def _address(context: Any, builder: Any, kind: Any, counters: Any, number: Any) -> Any:
    return builder.gep(context.make_array(kind)(context, builder, counters).data, [number])


@intrinsic
def increase(context: Any, counters: Any, number: Any) -> Any:
    """Add one to a counter, after all that this thread has written; returns what it was."""

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        address = _address(context, builder, signature.args[0], *arguments)
        return builder.atomic_rmw("add", address, ir.Constant(ir.IntType(64), 1), "seq_cst")

    return types.int64(counters, types.intp), emit


@intrinsic
def count(context: Any, counters: Any, number: Any) -> Any:
    """Value of a counter, after which all can be read that was written before it was increased."""

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        address = _address(context, builder, signature.args[0], *arguments)
        return builder.load_atomic(address, "seq_cst", 8)

    return types.int64(counters, types.intp), emit


@compiled
def wait_for(counters, number, least):  # type: ignore[no-untyped-def]
    """Return once a counter is `least` or more."""
    looks = 0
    while count(counters, number) < least:
        looks += 1
        if looks > PATIENCE:
            _give_way()
