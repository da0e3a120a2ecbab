"""Whether there is room for results; a job on a full disk cannot even say that it is full."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from carillon.files import cause
from carillon.progress import say

ENOUGH = 1 << 20
"""Bytes that a run can do nothing without."""


def tell_if_full(folder: Path) -> None:
    """Say in a sentence that no megabyte can be written to `folder`, if that is so."""
    try:
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(bytes(ENOUGH))
            file.flush()
            os.fsync(file.fileno())
    except FileNotFoundError:  # No job has made it yet.
        pass
    except OSError as error:
        say(f"{folder}: cannot be written ({cause(error)})")
