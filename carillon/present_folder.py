"""Files of the present folder that Python and libraries would take for code or for settings.

People open folders of others'. Python puts the present folder first where it starts with `-c` or
`-m`, as it does for the processes of a pool; numba reads `.numba_config.yaml` there, whose cache
holds code, and matplotlib reads `matplotlibrc`. None of these counts here. PETSc's files are the
matter of `carillon.petsc`.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, MutableMapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from carillon.loading import while_loading

_NUMBA = "numba.core.config"
_ROOT = Path(__file__).resolve().parent.parent
_ELSEWHERE = "/"


def ignore_settings() -> None:
    """Have numba and matplotlib, if loaded later, read no settings in the present folder."""
    while_loading("matplotlib", _elsewhere)
    while_loading(_NUMBA, _without_file)


def ignore_modules(environment: MutableMapping[str, str], path: Sequence[str]) -> None:
    """Have Python, where it is started from here, import nothing from the present folder.

    Parameters
    ----------
    path
        Where this process looks for modules. Where the first is the folder of Carillon itself, as
        in its checkout, processes that are started from here look there, too.

    Examples
    --------
    >>> environment = {}
    >>> ignore_modules(environment, ["/somewhere", "/else"])
    >>> environment
    {'PYTHONSAFEPATH': '1'}
    """
    if not environment.get("PYTHONSAFEPATH") and path and Path(path[0] or ".").resolve() == _ROOT:
        others = environment.get("PYTHONPATH")
        environment["PYTHONPATH"] = os.pathsep.join([str(_ROOT), *([others] if others else [])])
    environment["PYTHONSAFEPATH"] = "1"


@contextmanager
def _elsewhere() -> Iterator[None]:
    """Another present folder, of all threads, in the body."""
    here = os.open(".", os.O_PATH | os.O_DIRECTORY)
    try:
        os.chdir(_ELSEWHERE)
        yield
    finally:
        os.fchdir(here)
        os.close(here)


@contextmanager
def _without_file() -> Iterator[None]:
    """Likewise, and numba looks for its file nowhere later, which it does whenever it compiles."""
    with _elsewhere():
        yield
    if config := sys.modules.get(_NUMBA):
        config.__dict__["_config_fname"] = os.devnull
