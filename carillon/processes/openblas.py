"""Settings that OpenBLAS reads from the environment when it is loaded.

Several copies of OpenBLAS live in one process: numpy's, scipy's and PETSc's.  An idle worker thread
of one copy spins for 2^26 cycles beside the workers of another, which halves the speed of code that
calls them in turn; it is told to go to sleep at once.
"""

from __future__ import annotations

from collections.abc import MutableMapping

SETTINGS = {"OPENBLAS_THREAD_TIMEOUT": "4"}


def configure(environment: MutableMapping[str, str]) -> None:
    """Put the settings into `environment`, where the user has not set them.

    Examples
    --------
    >>> environment = {"OPENBLAS_THREAD_TIMEOUT": "26"}
    >>> configure(environment)
    >>> environment
    {'OPENBLAS_THREAD_TIMEOUT': '26'}
    """
    for name, value in SETTINGS.items():
        environment.setdefault(name, value)
