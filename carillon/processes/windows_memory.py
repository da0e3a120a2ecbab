"""Memory of the machine and of this process on Windows, in bytes."""

import ctypes
from typing import Any


class _Machine(ctypes.Structure):
    _fields_ = (
        ("length", ctypes.c_uint32),
        ("load", ctypes.c_uint32),
        *((name, ctypes.c_uint64) for name in ("total", "available", "pages", "free_pages")),
        *((name, ctypes.c_uint64) for name in ("addresses", "free_addresses", "extended")),
    )


class _Process(ctypes.Structure):
    _fields_ = (
        ("length", ctypes.c_uint32),
        ("faults", ctypes.c_uint32),
        ("peak", ctypes.c_size_t),
        *((f"other_{number}", ctypes.c_size_t) for number in range(7)),
    )


def machine() -> tuple[int, int]:
    """Memory of the machine, and what of it is free."""
    told = _Machine(length=ctypes.sizeof(_Machine))
    _kernel().GlobalMemoryStatusEx(ctypes.byref(told))
    return told.total, told.available


def peak() -> int:
    """Largest resident memory so far of this process."""
    told = _Process(length=ctypes.sizeof(_Process))
    process = ctypes.c_void_p(-1)  # this one, as GetCurrentProcess names it
    _kernel().K32GetProcessMemoryInfo(process, ctypes.byref(told), told.length)
    return told.peak


def _kernel() -> Any:
    return getattr(ctypes, "windll").kernel32  # noqa: B009
