"""Programs that tests run to their end (test support)."""

import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

from tests.patience import HANG_SECONDS

CHECKOUT = Path(__file__).resolve().parent.parent


def checkout_environment(**variables: str) -> dict[str, str]:
    """The environment, in which modules are found that are not installed, and more variables."""
    return {**os.environ, "PYTHONPATH": str(CHECKOUT), **variables}


def run(
    *words: object,
    cwd: Path | str | None = None,
    env: Mapping[str, str] | None = None,
    check: bool = False,
) -> subprocess.CompletedProcess[str]:
    """Run a program; what it prints is text of the result."""
    return subprocess.run(
        [str(word) for word in words],
        cwd=cwd,
        env=env,
        check=check,
        capture_output=True,
        text=True,
        timeout=HANG_SECONDS,
    )


def python(*words: object, **options) -> subprocess.CompletedProcess[str]:
    """Run this Python; options are those of `run`."""
    return run(sys.executable, *words, **options)
