"""Small file systems, to be full on."""

import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.programs import run

KIB = 1024


@contextmanager
def disk_on(folder: Path, size: int) -> Iterator[Callable[[int], None]]:
    """Mount a file system of `size` bytes on a folder; yields what gives it other bytes to spare.

    The test is skipped where none can be mounted.
    """
    if os.geteuid() != 0:
        pytest.skip("only root can mount a small file system")
    _mount(folder, f"size={size // KIB}k")
    try:
        yield lambda spare: _mount(
            folder, f"remount,size={(shutil.disk_usage(folder).used + spare) // KIB}k"
        )
    finally:
        run("umount", folder)


def _mount(folder: Path, options: str) -> None:
    command = ["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(folder)]
    done = run(*command)
    if done.returncode:
        pytest.skip(f"no file system can be mounted here: {done.stderr}")
